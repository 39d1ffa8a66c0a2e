//! What an SRDF says: pairs of links that are not checked for collision, and named postures.

use std::path::{Path, PathBuf};

use quick_xml::Reader;
use quick_xml::events::attributes::AttrError;
use quick_xml::events::{BytesStart, Event};

/// How deep elements may be nested, as in a URDF: an SRDF's own go 3 deep.
const DEPTH: usize = 128;

/// Why an SRDF cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SrdfError {
    /// The file cannot be read.
    #[error("cannot read SRDF {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        error: std::io::Error,
    },
    /// The file is no XML, or a `disable_collisions` lacks a link.
    #[error("SRDF {}: {reason}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// A named posture of a group of joints.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupState {
    /// Its name, for instance `home`.
    pub name: String,
    /// Joints by name and where they are. \[rad\] or \[m\]
    pub joints: Vec<(String, f64)>,
}

/// The pairs of every `<disable_collisions link1 link2>`.
pub(crate) fn disabled_pairs(path: &Path) -> Result<Vec<(String, String)>, SrdfError> {
    Ok(read(path)?.pairs)
}

/// Every `<group_state name>` with the one value of each of its `<joint name value>`s, `home` and
/// `ready` first.
///
/// # Errors
/// When the file cannot be read or is no SRDF.
pub fn group_states(path: &Path) -> Result<Vec<GroupState>, SrdfError> {
    let mut states = read(path)?.states;
    states.sort_by_key(|state| match state.name.to_lowercase().as_str() {
        "home" => 0,
        "ready" => 1,
        _ => 2,
    });
    Ok(states)
}

#[derive(Debug, Default, PartialEq)]
struct Srdf {
    pairs: Vec<(String, String)>,
    states: Vec<GroupState>,
}

fn read(path: &Path) -> Result<Srdf, SrdfError> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| SrdfError::Read { path: path.to_path_buf(), error })?;
    parse(&text).map_err(|reason| SrdfError::Parse { path: path.to_path_buf(), reason })
}

fn parse(text: &str) -> Result<Srdf, String> {
    let mut reader = Reader::from_str(text);
    let mut srdf = Srdf::default();
    let mut depth = 0usize;
    // How deep the group state is that is being read.
    let mut inside = None;
    loop {
        let at = reader.buffer_position();
        let event = reader.read_event().map_err(|e| format!("{e} near byte {at}"))?;
        let element = match &event {
            Event::Start(e) => {
                depth += 1;
                if depth > DEPTH {
                    return Err(format!(
                        "<{}> near byte {at} is nested more than {DEPTH} deep: no SRDF is",
                        e.name().as_ref()
                    ));
                }
                e
            }
            Event::Empty(e) => e,
            Event::End(_) => {
                if inside == Some(depth) {
                    inside = None;
                }
                depth = depth.saturating_sub(1);
                continue;
            }
            Event::Eof if depth > 0 => return Err("the text ends inside an element".into()),
            Event::Eof => return Ok(srdf),
            _ => continue,
        };
        let (kind, [a, b]) = match element.name().as_ref() {
            "disable_collisions" => ("disable_collisions", ["link1", "link2"]),
            "group_state" => ("group_state", ["name", "group"]),
            "joint" if inside.is_some() => ("joint", ["name", "value"]),
            _ => continue,
        };
        let lacks = || format!("{kind} near byte {at} lacks {a} or {b}");
        let [first, second] = attributes(element, [a, b])
            .map_err(|e| format!("{e} near byte {at}"))?
            .ok_or_else(lacks)?;
        match (kind, srdf.states.last_mut()) {
            ("disable_collisions", _) => srdf.pairs.push((first, second)),
            ("joint", Some(state)) => {
                // A joint of several degrees of freedom has several values: no arm has one.
                if !second.trim().contains(char::is_whitespace) {
                    let value = second.trim().parse().map_err(|e| {
                        format!(
                            "the value `{second}` of {first} in group_state {}: {e}",
                            state.name
                        )
                    })?;
                    state.joints.push((first, value));
                }
            }
            _ => {
                if matches!(event, Event::Start(_)) {
                    inside = Some(depth);
                }
                srdf.states.push(GroupState { name: first, joints: Vec::new() });
            }
        }
    }
}

/// Two attributes of an element; `None` where one is missing.
fn attributes(
    element: &BytesStart<'_>,
    names: [&str; 2],
) -> Result<Option<[String; 2]>, AttrError> {
    let mut values = [None, None];
    for attribute in element.attributes() {
        let attribute = attribute?;
        if let Some(k) = names.iter().position(|n| *n == attribute.key.as_ref()) {
            values[k] = Some(attribute.value.into_owned());
        }
    }
    let [first, second] = values;
    Ok(first.zip(second).map(|(a, b)| [a, b]))
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn reads_pairs_and_refuses_half_ones() {
        let text = r#"<?xml version="1.0"?><robot name="r"><!-- c --><group name="g"/>
            <disable_collisions link1="a" link2="b" reason="Never"/>
            <disable_collisions reason="x" link2="d" link1="c"></disable_collisions></robot>"#;
        let pair = |a: &str, b: &str| (a.to_string(), b.to_string());
        assert_eq!(parse(text).unwrap().pairs, [pair("a", "b"), pair("c", "d")]);
        assert!(parse(r#"<robot><disable_collisions link1="a"/></robot>"#).is_err());
        assert!(parse("<robot><disable").is_err());
        assert!(parse("<robot>").is_err());
    }

    #[test]
    fn deep_nesting_is_refused() {
        let nested = |depth: usize| "<r>".repeat(depth) + &"</r>".repeat(depth);
        parse(&nested(128)).unwrap();
        let why = parse(&nested(129)).unwrap_err();
        assert_eq!(why, "<r> near byte 384 is nested more than 128 deep: no SRDF is");
    }

    #[test]
    fn reads_postures() {
        let text = r#"<robot name="r"><group name="arm"><joint name="j1"/></group>
            <group_state name="up" group="arm"><joint name="j1" value="0.5"/>
            <joint name="base" value="1 2 0"/><joint name="j2" value=" -1 "/></group_state>
            <group_state name="bare" group="arm"/><joint name="j3"/></robot>"#;
        let states = parse(text).unwrap().states;
        assert_eq!(states.len(), 2);
        assert_eq!(states[0].name, "up");
        assert_eq!(states[0].joints, [("j1".to_owned(), 0.5), ("j2".to_owned(), -1.0)]);
        assert_eq!(states[1].joints, []);
        let bad = |inner: &str| {
            parse(&format!("<r><group_state name='a' group='b'>{inner}</group_state></r>"))
        };
        assert!(bad("<joint name='j'/>").unwrap_err().contains("value"));
        assert!(
            bad("<joint name='j' value='x'/>").unwrap_err().contains("`x` of j in group_state a")
        );
        assert!(parse("<r><group_state group='b'/></r>").is_err());
    }
}
