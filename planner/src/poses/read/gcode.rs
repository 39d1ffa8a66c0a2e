//! G-code: straight cuts in the order of a program.

use std::path::Path;

use gcode::{Block, Code, Value};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::found::{Poses, PosesError};

/// What is read.
const WANTED: &str = "straight motion, G0 and G1, in G17, G20, G21, G90 or G91";
/// What changes nothing of where the tool goes: plane, units and distances are looked at apart, work
/// offsets stand in `--offset`, compensation off, dwell, exact stop, feed mode.
const PASSED: [&str; 18] = [
    "4", "17", "40", "49", "54", "55", "56", "57", "58", "59", "61", "64", "69", "80", "93", "94",
    "95", "97",
];
/// Digits before the point that a number may have: the parser counts G, M and T by tenths in 32 bits.
const DIGITS: usize = 8;
/// An inch. \[m\]
const INCH: f64 = 0.0254;

/// Where the program is.
struct Machine {
    /// In metres from the origin of the work offset; an axis that was never told of is unknown.
    at: [Option<f64>; 3],
    unit: f64,
    relative: bool,
    /// Whether the last motion was a cut.
    cuts: bool,
}

/// Poses of the tool along G1 motions, its z axis down (−z of the program), its x axis along the
/// program's. Where G0 goes the tool is off the part: a segment ends there.
pub(super) fn read(text: &str, path: &Path) -> Result<Poses, PosesError> {
    if let Some(line) = text.lines().position(has_a_number_too_large) {
        let what = format!("a number of more than {DIGITS} digits before its point");
        return Err(PosesError::Line { path: path.into(), line: line + 1, what, wanted: WANTED });
    }
    let program = gcode::parse(text).map_err(|all| {
        let what = all.iter().next().map_or_else(String::new, ToString::to_string);
        PosesError::Syntax { path: path.into(), what }
    })?;
    let mut machine = Machine { at: [None; 3], unit: 1e-3, relative: false, cuts: false };
    let mut segments: Vec<Vec<Isometry3<f64>>> = Vec::new();
    let (mut unit_told, mut offsets) = (false, Vec::new());
    for block in &program.blocks {
        let wrong = |what: String| PosesError::Line {
            path: path.into(),
            line: block.span.line + 1,
            what,
            wanted: WANTED,
        };
        let mut motion = false;
        for code in &block.codes {
            let Code::General(code) = code else { continue };
            match code.number.to_string().as_str() {
                "0" => (machine.cuts, motion) = (false, true),
                "1" => (machine.cuts, motion) = (true, true),
                "20" => (machine.unit, unit_told) = (INCH, true),
                "21" => (machine.unit, unit_told) = (1e-3, true),
                "90" => machine.relative = false,
                "91" => machine.relative = true,
                number if PASSED.contains(&number) => {
                    if ("54"..="59").contains(&number) && !offsets.contains(&format!("G{number}")) {
                        offsets.push(format!("G{number}"));
                    }
                }
                number => return Err(wrong(format!("G{number} is not followed"))),
            }
        }
        let Some(to) = machine.target(block, motion).map_err(wrong)? else { continue };
        let from = std::mem::replace(&mut machine.at, to);
        if !machine.cuts {
            segments.push(Vec::new());
            continue;
        }
        let known = |at: [Option<f64>; 3]| at.into_iter().collect::<Option<Vec<f64>>>();
        let (Some(from), Some(to)) = (known(from), known(to)) else {
            return Err(wrong("a cut from or to where no line has said X, Y and Z".into()));
        };
        if segments.last().is_none_or(Vec::is_empty) {
            segments.push(vec![pose(&from)]);
        }
        if let Some(segment) = segments.last_mut()
            && from != to
        {
            segment.push(pose(&to));
        }
    }
    let file = path.display();
    let mut notes = Vec::new();
    if !unit_told {
        notes.push(format!("{file}: neither G20 nor G21 is there: millimetres are taken"));
    }
    if !offsets.is_empty() {
        let offsets = offsets.join(", ");
        notes.push(format!("{file}: {offsets}: where its origin is, --offset says"));
    }
    Ok(Poses { segments, notes })
}

/// Whether a letter has a number with more than [`DIGITS`] digits before its point.
fn has_a_number_too_large(line: &str) -> bool {
    line.split(|c: char| c.is_ascii_alphabetic()).skip(1).any(|word| {
        let whole = word.split('.').next().unwrap_or(word);
        whole.chars().filter(char::is_ascii_digit).count() > DIGITS
    })
}

impl Machine {
    /// Where a line of the program goes to, if it moves.
    fn target(&self, block: &Block, motion: bool) -> Result<Option<[Option<f64>; 3]>, String> {
        let args = block.codes.iter().flat_map(|code| match code {
            Code::General(code) => code.args.as_slice(),
            Code::Miscellaneous(code) => code.args.as_slice(),
            _ => &[],
        });
        let words = args
            .map(|a| (a.letter, &a.value))
            .chain(block.word_addresses.iter().map(|w| (w.letter, &w.value)));
        let (mut to, mut moves) = (self.at, motion);
        for (letter, value) in words {
            let axis = match letter.to_ascii_uppercase() {
                'X' => 0,
                'Y' => 1,
                'Z' => 2,
                letter @ ('A' | 'B' | 'C' | 'U' | 'V' | 'W') => {
                    return Err(format!("axis {letter} is not followed"));
                }
                _ => continue,
            };
            let Value::Literal(value) = value else {
                return Err(format!("{letter} is a variable"));
            };
            let value = f64::from(*value) * self.unit;
            if !value.is_finite() {
                return Err(format!("{letter} is not finite"));
            }
            let told = "a relative motion from where no line has said an axis";
            to[axis] = Some(match self.relative {
                true => self.at[axis].ok_or(told)? + value,
                false => value,
            });
            moves = true;
        }
        Ok(moves.then_some(to))
    }
}

/// The tool at a place of the program, its z axis down.
fn pose(at: &[f64]) -> Isometry3<f64> {
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Isometry3::from_parts(Translation3::new(at[0], at[1], at[2]), down)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuts(text: &str) -> Result<Vec<Vec<[f64; 3]>>, PosesError> {
        let poses = read(text, Path::new("part.nc"))?;
        let at = |p: &Isometry3<f64>| p.translation.vector.into();
        let of = |s: &Vec<Isometry3<f64>>| s.iter().map(at).collect();
        Ok(poses.segments.iter().filter(|s| !s.is_empty()).map(of).collect())
    }

    fn is_near(found: &[Vec<[f64; 3]>], wanted: &[&[[f64; 3]]]) {
        assert_eq!(found.len(), wanted.len(), "{found:?}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert_eq!(found.len(), wanted.len(), "{found:?}");
            for (a, b) in found.iter().flatten().zip(wanted.iter().flatten()) {
                assert!((a - b).abs() < 1e-8, "{found:?} {wanted:?}");
            }
        }
    }

    #[test]
    fn cuts_are_segments_between_rapid_motions() {
        let text = "%\n(a part)\nG21 G90 G17\nM3 S1000\nG0 X10 Y0 Z5\nG1 Z0 F100\nX20 ; modal\nY10\n\
                    G0 Z5\nG0 X0 Y0\nG1 Z0\nG91\nG1 X5 Y-5\nM30\n%\n";
        is_near(
            &cuts(text).unwrap(),
            &[
                &[[0.01, 0.0, 0.005], [0.01, 0.0, 0.0], [0.02, 0.0, 0.0], [0.02, 0.01, 0.0]],
                &[[0.0, 0.0, 0.005], [0.0, 0.0, 0.0], [0.005, -0.005, 0.0]],
            ],
        );
        is_near(
            &cuts("G20\nG0 X1 Y0 Z0\nG01 X2\n").unwrap(),
            &[&[[0.0254, 0.0, 0.0], [0.0508, 0.0, 0.0]]],
        );
        let down = read("G0 X0 Y0 Z0\nG1 X1\n", Path::new("a.nc")).unwrap();
        assert!((down.segments.concat()[0].rotation * Vector3::z() + Vector3::z()).norm() < 1e-12);
        assert!(down.notes[0].contains("millimetres"));
    }

    #[test]
    fn what_is_no_straight_motion_is_refused() {
        for (text, line) in [
            ("G0 X0 Y0 Z0\nG2 X1 Y1 I1\n", 2),
            ("G1 X1 Y1 Z1\n", 1),
            ("G91\nG0 X1\n", 2),
            ("G0 X0 Y0 Z0\nG1 A30\n", 2),
            ("G28\n", 1),
            ("G21\nG429496730 X1\n", 2),
            ("G0 X0 Y0 Z0\nM 99999999999\n", 2),
        ] {
            match cuts(text) {
                Err(PosesError::Line { line: found, .. }) => assert_eq!(found, line, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }
}
