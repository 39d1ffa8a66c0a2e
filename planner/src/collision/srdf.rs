//! Pairs of links that an SRDF takes out of collision checking.

use quick_xml::Reader;
use quick_xml::events::Event;
use std::path::{Path, PathBuf};

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

/// The pairs of every `<disable_collisions link1 link2>`.
pub(crate) fn disabled_pairs(path: &Path) -> Result<Vec<(String, String)>, SrdfError> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| SrdfError::Read { path: path.to_path_buf(), error })?;
    parse(&text).map_err(|reason| SrdfError::Parse { path: path.to_path_buf(), reason })
}

fn parse(text: &str) -> Result<Vec<(String, String)>, String> {
    let mut reader = Reader::from_str(text);
    let mut pairs = Vec::new();
    let mut depth = 0usize;
    loop {
        let at = reader.buffer_position();
        let event = reader.read_event().map_err(|e| format!("{e} near byte {at}"))?;
        let element = match &event {
            Event::Start(e) => {
                depth += 1;
                e
            }
            Event::Empty(e) => e,
            Event::End(_) => {
                depth = depth.saturating_sub(1);
                continue;
            }
            Event::Eof if depth > 0 => return Err("the text ends inside an element".into()),
            Event::Eof => return Ok(pairs),
            _ => continue,
        };
        if element.name().as_ref() != b"disable_collisions" {
            continue;
        }
        let mut link = [None, None];
        for attribute in element.attributes() {
            let attribute = attribute.map_err(|e| format!("{e} near byte {at}"))?;
            let slot = match attribute.key.as_ref() {
                b"link1" => 0,
                b"link2" => 1,
                _ => continue,
            };
            link[slot] = Some(String::from_utf8_lossy(&attribute.value).into_owned());
        }
        let [Some(first), Some(second)] = link else {
            return Err(format!("disable_collisions near byte {at} lacks link1 or link2"));
        };
        pairs.push((first, second));
    }
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
        assert_eq!(parse(text).unwrap(), [pair("a", "b"), pair("c", "d")]);
        assert!(parse(r#"<robot><disable_collisions link1="a"/></robot>"#).is_err());
        assert!(parse("<robot><disable").is_err());
        assert!(parse("<robot>").is_err());
    }
}
