//! Reading tool poses and tolerances.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

/// How far the tool may be from a pose and still meet it.
///
/// Along and about the axes of the pose: x, y, z \[m\], then the tilt of the tool's z axis about x
/// and y and the turn about z \[rad\], each to either side; infinite: free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance(pub [f64; 6]);

impl Tolerance {
    /// Position and axis of the tool exact, the turn about its axis free.
    pub const AXIS: Self = Self([0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY]);
}

impl FromStr for Tolerance {
    type Err = String;

    /// Six numbers, comma-separated, or `free`.
    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<f64> = text
            .split(',')
            .map(|part| match part.trim() {
                "free" => Ok(f64::INFINITY),
                number => match number.parse::<f64>() {
                    Ok(value) if value >= 0.0 => Ok(value),
                    _ => Err(format!("`{number}`: a number of at least 0, or `free`, is wanted")),
                },
            })
            .collect::<Result<_, _>>()?;
        parts
            .try_into()
            .map(Self)
            .map_err(|v: Vec<f64>| format!("{} numbers, not 6: X,Y,Z,RX,RY,RZ", v.len()))
    }
}

/// Why a file of poses cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PosesError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A line is no pose.
    #[error(
        "{}, line {line}: {what}; wanted is one pose a line: time,x,y,z,qx,qy,qz,qw or \
         x,y,z,qx,qy,qz,qw",
        path.display()
    )]
    Line {
        /// Which file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        what: String,
    },
    /// No pose at all.
    #[error("{}: no pose in it", path.display())]
    Empty {
        /// Which file.
        path: PathBuf,
    },
}

/// Reads poses of the tool in the robot's root frame from comma-separated text: seven numbers a
/// line (position \[m\], unit quaternion x, y, z, w), or eight with a time before them, which is
/// not looked at. A first line without numbers is a heading.
///
/// # Errors
/// Names the file and the line.
pub fn read(path: &Path) -> Result<Vec<Isometry3<f64>>, PosesError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| PosesError::File { path: path.into(), source })?;
    let mut poses = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').trim();
        let heading = k == 0 && line.split(',').all(|part| part.trim().parse::<f64>().is_err());
        if line.is_empty() || line.starts_with('#') || heading {
            continue;
        }
        let pose =
            pose(line).map_err(|what| PosesError::Line { path: path.into(), line: k + 1, what })?;
        poses.push(pose);
    }
    if poses.is_empty() { Err(PosesError::Empty { path: path.into() }) } else { Ok(poses) }
}

fn pose(line: &str) -> Result<Isometry3<f64>, String> {
    let numbers: Vec<f64> = line
        .split(',')
        .map(|part| part.trim().parse::<f64>().map_err(|e| format!("`{}`: {e}", part.trim())))
        .collect::<Result<_, _>>()?;
    let [x, y, z, qx, qy, qz, qw] = match numbers.as_slice() {
        [_, rest @ ..] if rest.len() == 7 => rest,
        rest => rest,
    }
    .try_into()
    .map_err(|_| format!("{} numbers", numbers.len()))?;
    if !numbers.iter().all(|n| n.is_finite()) {
        return Err("a number is not finite".into());
    }
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    if (quaternion.norm() - 1.0).abs() > 1e-3 {
        return Err(format!("the quaternion's length is {:.4}, not 1", quaternion.norm()));
    }
    let rotation = UnitQuaternion::new_normalize(quaternion);
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), rotation))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn read_text(text: &str) -> Result<Vec<Isometry3<f64>>, PosesError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        read(file.path())
    }

    #[test]
    fn reads_poses_with_and_without_time() {
        let poses = read_text("time,x,y,z,a,b,c,d\n0,1,2,3,0,0,0,1\n\n1,4,5,6,1,0,0,0\n").unwrap();
        assert_eq!(poses.len(), 2);
        assert_eq!(poses[1].translation.vector, nalgebra::Vector3::new(4.0, 5.0, 6.0));
        assert_eq!(read_text("1,2,3,0,0,0,1").unwrap()[0], poses[0]);
    }

    #[test]
    fn says_which_line_is_broken() {
        for (text, line) in [
            ("0,1,2,3,0,0,0,1\n0,1,2", 2),
            ("0,1,2,3,0,0,0,2", 1),
            ("1,2,3,0,0,0,nan", 1),
            ("h\n1,2,3,0,0,0,x", 2),
        ] {
            match read_text(text) {
                Err(PosesError::Line { line: found, .. }) => assert_eq!(found, line, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
        assert!(matches!(read_text("a,b\n"), Err(PosesError::Empty { .. })));
    }

    #[test]
    fn reads_tolerances() {
        let wok: Tolerance = "0.05,0.05,0,0,0,free".parse().unwrap();
        assert_eq!(wok, Tolerance([0.05, 0.05, 0.0, 0.0, 0.0, f64::INFINITY]));
        assert!("1,2,3".parse::<Tolerance>().is_err());
        assert!("0,0,0,0,0,-1".parse::<Tolerance>().is_err());
    }
}
