//! Poses in YAML or JSON: PoseArray, PoseStamped, noether's tool paths.

use std::path::Path;

use nalgebra::Isometry3;
use serde_json::{Map, Value};

use super::found::{Poses, PosesError};
use super::quaternion::{QuaternionOrder, Quaternions, isometry};

/// In which a tree is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Syntax {
    Json,
    Yaml,
}

/// Deepest list in a list: a tool path needs four.
const DEPTH: usize = 16;

/// Poses in lists of any depth, in one document or several. What is neither pose nor list nor leads to
/// one (a header, a name) is passed over.
pub(super) fn read(
    text: &str,
    syntax: Syntax,
    path: &Path,
    order: Option<QuaternionOrder>,
) -> Result<Poses, PosesError> {
    let wrong = |what: String| PosesError::Syntax { path: path.into(), what };
    let documents: Vec<Value> = match syntax {
        Syntax::Json => vec![serde_json::from_str(text).map_err(|e| wrong(e.to_string()))?],
        Syntax::Yaml => serde_saphyr::from_multiple(text).map_err(|e| wrong(e.to_string()))?,
    };
    let is_plan =
        |node: &Value| ["format", "fingerprint", "knots"].iter().all(|k| node.get(k).is_some());
    if documents.iter().any(is_plan) {
        return Err(PosesError::Plan { path: path.into() });
    }
    let mut reader = Reader { order, ..Reader::default() };
    let mut loose = Vec::new();
    for document in &documents {
        reader.walk(document, "", 0, &mut loose).map_err(|(place, what)| PosesError::Pose {
            path: path.into(),
            place,
            what,
        })?;
    }
    reader.segments.push(loose);
    let file = path.display().to_string();
    let mut notes = Vec::new();
    if reader.guessed {
        notes.push(format!(
            "{file}: lists of four are taken for quaternions x, y, z, w: --quat wxyz where w is first"
        ));
    }
    if !reader.frames.is_empty() {
        let frames = reader.frames.join(", ");
        notes.push(format!(
            "{file}: poses of the frame {frames} are taken in the robot's root frame, moved by --offset"
        ));
    }
    notes.extend(reader.quaternions.note(&file));
    Ok(Poses { segments: reader.segments, notes })
}

/// What was found on the way through the tree.
#[derive(Default)]
struct Reader {
    order: Option<QuaternionOrder>,
    segments: Vec<Vec<Isometry3<f64>>>,
    quaternions: Quaternions,
    frames: Vec<String>,
    /// Whether a quaternion's order was guessed.
    guessed: bool,
}

/// Where in the tree, and what is wrong there.
type Wrong = (String, String);

impl Reader {
    /// Finds what is below a node; a pose goes to the list that it stands in.
    fn walk(
        &mut self,
        node: &Value,
        place: &str,
        depth: usize,
        list: &mut Vec<Isometry3<f64>>,
    ) -> Result<(), Wrong> {
        if depth > DEPTH {
            return Err((place.into(), "lists in lists without end".into()));
        }
        let below = |name: &str| match place {
            "" => name.to_owned(),
            place => format!("{place}.{name}"),
        };
        match node {
            Value::Array(nodes) => {
                let mut own = Vec::new();
                for (k, node) in nodes.iter().enumerate() {
                    self.walk(node, &format!("{place}[{k}]"), depth + 1, &mut own)?;
                }
                self.segments.push(own);
            }
            Value::Object(fields) => {
                if let Some(pose) = self.pose(fields, place)? {
                    list.push(pose);
                    return Ok(());
                }
                let frame = fields.get("frame_id").and_then(Value::as_str);
                if let Some(frame) = frame.filter(|frame| !frame.is_empty())
                    && !self.frames.iter().any(|known| known == frame)
                {
                    self.frames.push(frame.to_owned());
                }
                for (name, node) in fields {
                    self.walk(node, &below(name), depth + 1, list)?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// The pose that an object is, if it is one.
    fn pose(
        &mut self,
        fields: &Map<String, Value>,
        place: &str,
    ) -> Result<Option<Isometry3<f64>>, Wrong> {
        let wrong = |what: String| (place.to_owned(), what);
        let position = fields.get("position").or_else(|| fields.get("translation"));
        let rotation =
            ["orientation", "rotation", "quaternion"].iter().find_map(|n| fields.get(*n));
        let (at, turn) = if let (Some(position), Some(rotation)) = (position, rotation) {
            let at = vector(position).map_err(|e| wrong(format!("position: {e}")))?;
            let turn = self.quaternion(rotation).map_err(|e| wrong(format!("orientation: {e}")))?;
            (at, turn)
        } else if fields.contains_key("qw") {
            let at = numbers(fields, ["x", "y", "z"]).map_err(wrong)?;
            (at, numbers(fields, ["qx", "qy", "qz", "qw"]).map_err(wrong)?)
        } else {
            return Ok(None);
        };
        let (pose, length) = isometry(at, turn).map_err(wrong)?;
        self.quaternions.see(length, || place.to_owned());
        Ok(Some(pose))
    }

    /// x, y, z, w of a map with these names, or of a list.
    fn quaternion(&mut self, node: &Value) -> Result<[f64; 4], String> {
        match node {
            Value::Object(fields) => numbers(fields, ["x", "y", "z", "w"]),
            _ => {
                self.guessed |= self.order.is_none();
                let order = self.order.unwrap_or(QuaternionOrder::Xyzw);
                list::<4>(node).map(|four| order.xyzw(four))
            }
        }
    }
}

/// x, y, z of a map with these names, or of a list.
fn vector(node: &Value) -> Result<[f64; 3], String> {
    match node {
        Value::Object(fields) => numbers(fields, ["x", "y", "z"]),
        _ => list::<3>(node),
    }
}

fn numbers<const N: usize>(
    fields: &Map<String, Value>,
    names: [&str; N],
) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    for (value, name) in values.iter_mut().zip(names) {
        let number = fields.get(name).and_then(Value::as_f64);
        *value = number.ok_or_else(|| format!("`{name}` is missing, or no number"))?;
    }
    Ok(values)
}

fn list<const N: usize>(node: &Value) -> Result<[f64; N], String> {
    let numbers: Option<Vec<f64>> =
        node.as_array().and_then(|nodes| nodes.iter().map(Value::as_f64).collect());
    let numbers = numbers.ok_or_else(|| format!("{N} numbers are wanted"))?;
    numbers.try_into().map_err(|v: Vec<f64>| format!("{} numbers, not {N}", v.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yaml(text: &str) -> Result<Poses, PosesError> {
        read(text, Syntax::Yaml, Path::new("path.yaml"), None)
    }

    fn places(poses: &Poses) -> Vec<Vec<f64>> {
        let of = |s: &Vec<Isometry3<f64>>| s.iter().map(|p| p.translation.x).collect();
        poses.segments.iter().filter(|s| !s.is_empty()).map(of).collect()
    }

    #[test]
    fn a_pose_array_is_one_segment_and_its_frame_is_told() {
        let text = "header:\n  frame_id: table\nposes:\n- position: {x: 1, y: 2.0, z: 3}\n  \
                    orientation: {x: 0, y: 0, z: 0.6, w: 0.8}\n- position: {x: 2, y: 2, z: 3}\n  \
                    orientation: {x: 0, y: 0, z: 0.61, w: 0.8}\n---\n";
        let poses = yaml(text).unwrap();
        assert_eq!(places(&poses), [[1.0, 2.0]]);
        let turn = poses.segments.iter().flatten().next().unwrap().rotation;
        assert!((turn.k - 0.6).abs() < 1e-12 && (turn.w - 0.8).abs() < 1e-12);
        assert!(poses.notes[0].contains("frame table"), "{:?}", poses.notes);
        assert!(poses.notes[1].ends_with("1.0060 in poses[1]"), "{:?}", poses.notes);
    }

    #[test]
    fn innermost_lists_of_a_tool_path_are_segments() {
        let pose = |x: i32| format!("{{x: {x}, y: 0, z: 0, qw: 1, qx: 0, qy: 0, qz: 0}}");
        let text =
            format!("- - - {}\n    - {}\n  - - {}\n- - - {}\n", pose(1), pose(2), pose(3), pose(4));
        assert_eq!(places(&yaml(&text).unwrap()), [vec![1.0, 2.0], vec![3.0], vec![4.0]]);
        let json = r#"[[[{"x":1,"y":0,"z":0,"qw":0.6,"qx":0.8,"qy":0,"qz":0}]]]"#;
        let poses = read(json, Syntax::Json, Path::new("path.json"), None).unwrap();
        assert_eq!(places(&poses), [[1.0]]);
        assert!((poses.segments.concat()[0].rotation.i - 0.8).abs() < 1e-12);
    }

    #[test]
    fn lists_of_four_are_taken_in_the_order_that_is_said() {
        let text = "poses:\n- {position: [1, 2, 3], orientation: [1, 0, 0, 0]}\n";
        let guessed = yaml(text).unwrap();
        assert_eq!(guessed.segments.concat()[0].rotation.i, 1.0);
        assert!(guessed.notes[0].contains("--quat wxyz"));
        let order = Some(QuaternionOrder::Wxyz);
        let said = read(text, Syntax::Yaml, Path::new("p.yaml"), order).unwrap();
        assert_eq!((said.segments.concat()[0].rotation.w, said.notes.len()), (1.0, 0));
    }

    #[test]
    fn says_which_pose_is_broken() {
        for (text, place) in [
            (
                "poses:\n- {position: {x: 1, y: 2}, orientation: {x: 0, y: 0, z: 0, w: 1}}",
                "poses[0]",
            ),
            ("a:\n- {x: 1, y: 2, z: 3, qw: 2, qx: 0, qy: 0, qz: 0}", "a[0]"),
        ] {
            match yaml(text) {
                Err(PosesError::Pose { place: found, .. }) => assert_eq!(found, place, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
        for text in ["a: [1, 2", "- {x: 1, y: 2, z: .nan, qw: 1, qx: 0, qy: 0, qz: 0}"] {
            assert!(matches!(yaml(text), Err(PosesError::Syntax { .. })), "{text}");
        }
        assert_eq!(places(&yaml("a: 1").unwrap()), Vec::<Vec<f64>>::new());
    }
}
