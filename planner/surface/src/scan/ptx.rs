//! PTX: what a terrestrial scanner saw in rows and columns, with its place; one scan after another.

use nalgebra::{Matrix3, Matrix4, Point3, RowVector4};

use super::decode::{decode, number};
use super::error::{Malformed, Place, malformed};
use super::parsed::Parsed;
use super::warning::ScanWarning;

/// Numbers on each line of a scan's head: columns, rows, the scanner's place and axes, the matrix.
const HEAD: [usize; 10] = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4];

/// Reads all scans of the file, each moved by its matrix; pixels without a point (0, 0, 0) are left
/// out.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, Malformed> {
    let mut parsed = Parsed::default();
    let text = decode(bytes, &mut parsed.warnings)?;
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()).peekable();
    let (mut scans, mut nothing) = (0, 0);
    while lines.peek().is_some() {
        let mut head = Vec::with_capacity(HEAD.len());
        let mut last = 0;
        for wanted in HEAD {
            let Some((index, line)) = lines.next() else {
                return malformed(
                    Place::Line(text.lines().count()),
                    "the file ends in a scan's head",
                );
            };
            let values = numbers(line).filter(|values| values.len() == wanted);
            let Some(values) = values else {
                let cause = format!("a scan's head has {wanted} number(s) here");
                return malformed(Place::Line(index + 1), cause);
            };
            head.push(values);
            last = index + 1;
        }
        let pose = Matrix4::from_fn(|row, column| head[6 + column][row]);
        if !is_rigid(&pose) {
            return malformed(
                Place::Line(last),
                "the matrix that ends here is no rotation with a translation: its lines are the scanner's \
                 axes and its place, with 0, 0, 0 and 1 behind them",
            );
        }
        let count = head[0][0] * head[1][0];
        if !(count >= 0.0 && count.fract() == 0.0 && count < 1e12) {
            return malformed(Place::Line(1), format!("{count} points are announced"));
        }
        for found in 0..count as u64 {
            let Some((index, line)) = lines.next() else {
                let cause = format!("the file ends after {found} of {count} points of a scan");
                return malformed(Place::Line(text.lines().count()), cause);
            };
            let values = numbers(line);
            let Some([x, y, z, ..]) = values.as_deref() else {
                return malformed(Place::Line(index + 1), "a point has three numbers or more");
            };
            if [*x, *y, *z] == [0.0; 3] {
                nothing += 1;
            } else {
                parsed.points.push(pose.transform_point(&Point3::new(*x, *y, *z)));
            }
        }
        scans += 1;
        let at = pose.transform_point(&Point3::origin());
        parsed.sensor = (scans == 1).then_some(at);
    }
    if nothing > 0 {
        parsed.warnings.push(ScanWarning::AtOrigin { dropped: nothing });
    }
    parsed.warnings.push(ScanWarning::Convention {
        told: format!("{scans} scan(s) of a PTX file, each moved to where its matrix says"),
    });
    Ok(parsed)
}

fn numbers(line: &str) -> Option<Vec<f64>> {
    line.split_whitespace().map(number).collect()
}

/// Farthest that a matrix may be from a rotation: files hold few digits.
const ROUNDED: f64 = 1e-3;

/// Whether a matrix turns and moves, and does nothing else.
fn is_rigid(matrix: &Matrix4<f64>) -> bool {
    let turn = matrix.fixed_view::<3, 3>(0, 0).into_owned();
    let last = matrix.row(3) - RowVector4::new(0.0, 0.0, 0.0, 1.0);
    matrix.iter().all(|x| x.is_finite())
        && (turn * turn.transpose() - Matrix3::identity()).norm() < ROUNDED
        && turn.determinant() > 0.0
        && last.norm() < 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "2\n1\n5 6 7\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n5 6 7 1\n";

    #[test]
    fn every_scan_is_moved_by_its_matrix() {
        let once = format!("{HEAD}1 0 0 0.5\n0 0 0 0.5\n");
        let parsed = parse(once.as_bytes()).unwrap();
        // x of the scanner is y of the file.
        assert_eq!(parsed.points, [Point3::new(5.0, 7.0, 7.0)]);
        assert_eq!((parsed.sensor, parsed.viewpoint), (Some(Point3::new(5.0, 6.0, 7.0)), None));
        assert!(parsed.warnings.contains(&ScanWarning::AtOrigin { dropped: 1 }));
        let twice = parse((once.clone() + &once).as_bytes()).unwrap();
        assert_eq!((twice.points.len(), twice.sensor), (2, None));
    }

    #[test]
    fn what_is_cut_short_or_no_number_is_refused_with_its_line() {
        let of = |text: String| parse(text.as_bytes()).unwrap_err();
        assert_eq!(of(format!("{HEAD}1 2 3 0.5\n")).place, Place::Line(11));
        assert_eq!(of(format!("{HEAD}1 2 3 0.5\n1 2\n")).place, Place::Line(12));
        assert_eq!(of("2\n1 1\n".into()).place, Place::Line(2));
        assert!(of(HEAD.replacen('2', "1e11", 1)).cause.contains("0 of 100000000000"));
        assert!(of(HEAD.replacen('2', "-2", 1)).cause.contains("-2 points"));
        assert!(of("2\n1\n".into()).cause.contains("head"));
    }

    /// A translation in the last column divides by what is no 1; a scale or a mirror moves nothing
    /// to where it was.
    #[test]
    fn a_matrix_that_is_no_pose_is_refused() {
        let above: String = HEAD.lines().take(6).map(|line| format!("{line}\n")).collect();
        for matrix in [
            "0 -1 0 5\n1 0 0 6\n0 0 1 7\n0 0 0 1\n",
            "2 0 0 0\n0 2 0 0\n0 0 2 0\n5 6 7 1\n",
            "1 0 0 0\n0 1 0 0\n0 0 -1 0\n5 6 7 1\n",
            "0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 0\n",
        ] {
            let error = parse(format!("{above}{matrix}1 2 3 0.5\n1 2 3 0.5\n").as_bytes());
            let error = error.expect_err(matrix);
            assert_eq!(error.place, Place::Line(10), "{error:?}");
            assert!(error.cause.contains("no rotation"), "{error:?}");
        }
    }
}
