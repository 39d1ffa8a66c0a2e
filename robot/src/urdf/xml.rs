//! What `urdf-rs` does not tell: which attributes the text really has.
//!
//! `urdf-rs` fills a missing `<limit>` and missing soft limits with zeros, drops words that are not
//! numbers from vectors, and ignores `acceleration` and `jerk` in files that do not declare URDF
//! 1.2. A second, shallow reading of the same text restores what matters.

use std::collections::HashMap;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

/// How deep elements may be nested. A URDF's own elements go 6 deep and the plugins that are put
/// into it hardly deeper than 12; `urdf-rs` reads elements by recursion, and time that grows with
/// the square of the depth.
const DEPTH: usize = 128;

/// What the text of one `<joint>` holds.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointFacts {
    /// `<limit>` is there.
    pub(crate) has_limit: bool,
    /// `lower` or `upper` of `<limit>` is there (the other one is then 0 by definition).
    pub(crate) has_range: bool,
    /// `acceleration` of `<limit>`. [rad/s²] or [m/s²]
    pub(crate) acceleration: Option<f64>,
    /// `jerk` of `<limit>`. [rad/s³] or [m/s³]
    pub(crate) jerk: Option<f64>,
    /// At least one soft limit is there.
    pub(crate) has_soft_range: bool,
    /// `k_position` of `<safety_controller>` is there.
    pub(crate) has_k_position: bool,
}

/// Whether elements of xacro are in the text, that is not yet expanded.
pub(crate) fn is_xacro(text: &str) -> bool {
    let mut reader = Reader::from_str(text);
    loop {
        match reader.read_event() {
            Ok(Event::Start(e) | Event::Empty(e)) => {
                if e.name().as_ref().starts_with("xacro:") {
                    return true;
                }
            }
            Ok(Event::Eof) | Err(_) => return false,
            Ok(_) => {}
        }
    }
}

/// Reads the facts of every joint by name, and checks that vectors are three numbers.
pub(crate) fn joint_facts(text: &str) -> Result<HashMap<String, JointFacts>, String> {
    let mut reader = Reader::from_str(text);
    let mut facts = HashMap::new();
    let mut path: Vec<String> = Vec::new();
    let mut current = String::new();
    loop {
        let event = reader
            .read_event()
            .map_err(|e| format!("{e} near byte {}", reader.buffer_position()))?;
        let (element, opens) = match &event {
            Event::Start(e) => (e, true),
            Event::Empty(e) => (e, false),
            Event::End(_) => {
                path.pop();
                continue;
            }
            // What an entity stands for is read by `urdf-rs` alone, and may be as deep as you like.
            Event::DocType(text) if text.contains("<!ENTITY") => {
                return Err("entities are declared: write out what they stand for".into());
            }
            Event::Eof => return Ok(facts),
            _ => continue,
        };
        let name = element.name().as_ref().to_owned();
        if path.len() >= DEPTH {
            return Err(format!(
                "<{name}> near byte {} is nested more than {DEPTH} deep: no robot's description is",
                reader.buffer_position()
            ));
        }
        let parent = path.last().map(String::as_str);
        if path.len() == 1 && name == "joint" {
            current = attribute(element, "name")?.unwrap_or_default();
            facts.entry(current.clone()).or_default();
        } else if path.len() == 2 && parent == Some("joint") {
            read_joint_child(element, &name, facts.entry(current.clone()).or_default())?;
        }
        for key in ["xyz", "rpy", "size", "scale"] {
            if let Some(value) = attribute(element, key)? {
                let words = value.split_whitespace();
                if words.clone().count() != 3 || !words.clone().all(|w| w.parse::<f64>().is_ok()) {
                    return Err(format!("{key}=\"{value}\" of <{name}> must be three numbers"));
                }
            }
        }
        if opens {
            path.push(name);
        }
    }
}

/// A number that `<limit>` may have.
fn number(element: &BytesStart<'_>, name: &str) -> Result<Option<f64>, String> {
    let text = attribute(element, name)?;
    let wrong = |text| format!("{name}=\"{text}\" of <limit> is not a number");
    text.map(|text| text.trim().parse().map_err(|_| wrong(text))).transpose()
}

fn read_joint_child(
    element: &BytesStart<'_>,
    name: &str,
    facts: &mut JointFacts,
) -> Result<(), String> {
    match name {
        "limit" => {
            facts.has_limit = true;
            facts.has_range =
                attribute(element, "lower")?.is_some() || attribute(element, "upper")?.is_some();
            facts.acceleration = number(element, "acceleration")?;
            facts.jerk = number(element, "jerk")?;
        }
        "safety_controller" => {
            facts.has_soft_range = attribute(element, "soft_lower_limit")?.is_some()
                || attribute(element, "soft_upper_limit")?.is_some();
            facts.has_k_position = attribute(element, "k_position")?.is_some();
        }
        _ => {}
    }
    Ok(())
}

fn attribute(element: &BytesStart<'_>, key: &str) -> Result<Option<String>, String> {
    let Some(found) = element.try_get_attribute(key).map_err(|e| e.to_string())? else {
        return Ok(None);
    };
    unescape(&found.value).map(|v| Some(v.into_owned())).map_err(|e| e.to_string())
}
