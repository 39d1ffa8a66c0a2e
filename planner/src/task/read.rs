//! Reading tool poses and tolerances.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

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

/// Poses from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// Of the tool in the robot's root frame. \[m\]
    pub poses: Vec<Isometry3<f64>>,
    /// What had to be mended or guessed, in words.
    pub notes: Vec<String>,
}

/// How far the length of a quaternion may be from 1: two decimals and their rounding.
const LENGTH: f64 = 0.02;

/// How far it may be without a word.
const EXACT: f64 = 1e-3;

/// Reads poses of the tool in the robot's root frame from text, its numbers apart by commas,
/// semicolons, tabs or blanks: seven a line (position \[m\], unit quaternion x, y, z, w), or eight
/// with a time before them, which is not looked at. Names in a line before the poses, or in a
/// comment there, decide which column is which, and a position in another unit
/// than metres is refused. A quaternion whose length is within 2 % of 1 is
/// normalised, which is noted.
///
/// # Errors
/// Names the file and the line.
pub fn read(path: &Path) -> Result<Poses, PosesError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| PosesError::File { path: path.into(), source })?;
    let mut poses = Vec::new();
    let mut columns: Option<[usize; 7]> = None;
    let mut worst: Option<(usize, f64)> = None;
    let mut rounded = 0;
    for (k, line) in text.trim_start_matches('\u{feff}').lines().enumerate() {
        let comment = ["#", "//", "%"].iter().any(|mark| line.trim_start().starts_with(mark));
        let cells = cells(line.trim_start_matches(['#', '/', '%', ' ']));
        let at = |what| PosesError::Line { path: path.into(), line: k + 1, what };
        let heading = poses.is_empty() && cells.iter().all(|cell| cell.parse::<f64>().is_err());
        if cells.is_empty() || comment || heading {
            if poses.is_empty()
                && let Some(named) = named(&cells)
            {
                in_metres(&cells, &named).map_err(at)?;
                columns = Some(named);
            }
            continue;
        }
        let (pose, length) = pose(&cells, columns).map_err(at)?;
        let off = (length - 1.0).abs();
        if off > EXACT {
            rounded += 1;
            if worst.is_none_or(|(_, before)| off > (before - 1.0).abs()) {
                worst = Some((k + 1, length));
            }
        }
        poses.push(pose);
    }
    if poses.is_empty() {
        return Err(PosesError::Empty { path: path.into() });
    }
    let note = |(line, length): (usize, f64)| {
        format!(
            "{}: {rounded} quaternions normalised, whose length is not 1; it is {length:.4} in line \
             {line}",
            path.display()
        )
    };
    Ok(Poses { poses, notes: worst.map(note).into_iter().collect() })
}

/// The cells of a line, without quotes.
fn cells(line: &str) -> Vec<&str> {
    let mark = [',', ';', '\t'].into_iter().find(|&mark| line.contains(mark));
    let all: Vec<&str> = match mark {
        Some(mark) => line.trim().split(mark).collect(),
        None => line.split_ascii_whitespace().collect(),
    };
    let cells: Vec<&str> =
        all.iter().map(|cell| cell.trim().trim_matches(['"', '\'']).trim()).collect();
    if cells == [""] { Vec::new() } else { cells }
}

/// The columns of x, y, z, qx, qy, qz, qw by their names.
fn named(names: &[&str]) -> Option<[usize; 7]> {
    const NAMES: [&[&str]; 7] = [
        &["x", "px", "tx", "positionx", "posx", "translationx"],
        &["y", "py", "ty", "positiony", "posy", "translationy"],
        &["z", "pz", "tz", "positionz", "posz", "translationz"],
        &["qx", "orientationx", "rotationx", "quatx", "quaternionx"],
        &["qy", "orientationy", "rotationy", "quaty", "quaterniony"],
        &["qz", "orientationz", "rotationz", "quatz", "quaternionz"],
        &["qw", "orientationw", "rotationw", "quatw", "quaternionw"],
    ];
    let plain = |name: &str| {
        let name = name.split(['[', '(']).next().unwrap_or(name);
        name.chars().filter(|c| c.is_alphanumeric()).collect::<String>().to_lowercase()
    };
    let names: Vec<String> = names.iter().map(|name| plain(name)).collect();
    let mut columns = [0; 7];
    for (column, wanted) in columns.iter_mut().zip(NAMES) {
        *column = names.iter().position(|name| wanted.contains(&name.as_str()))?;
    }
    Some(columns)
}

/// Refuses a position that its column's name says to be in another unit than metres.
fn in_metres(names: &[&str], columns: &[usize; 7]) -> Result<(), String> {
    for name in columns[..3].iter().filter_map(|&column| names.get(column)) {
        let unit = name.split_once(['[', '(']).map_or("", |(_, unit)| unit);
        let unit = unit.trim_matches(|c: char| !c.is_alphanumeric()).to_lowercase();
        if !["", "m", "metre", "metres", "meter", "meters"].contains(&unit.as_str()) {
            return Err(format!("column `{name}` is in {unit}: give metres"));
        }
    }
    Ok(())
}

/// The pose in a line and the length of its quaternion as it is there.
fn pose(cells: &[&str], columns: Option<[usize; 7]>) -> Result<(Isometry3<f64>, f64), String> {
    let numbers: Vec<f64> = match columns {
        Some(columns) => {
            let cell = |&i: &usize| cells.get(i).ok_or(format!("{} cells", cells.len()));
            columns.iter().map(|i| number(cell(i)?)).collect::<Result<_, _>>()?
        }
        None => cells.iter().map(|cell| number(cell)).collect::<Result<_, _>>()?,
    };
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
    let length = quaternion.norm();
    if (length - 1.0).abs() > LENGTH {
        return Err(format!("the quaternion's length is {length:.4}, not 1"));
    }
    let rotation = UnitQuaternion::new_normalize(quaternion);
    Ok((Isometry3::from_parts(Translation3::new(x, y, z), rotation), length))
}

fn number(cell: &str) -> Result<f64, String> {
    cell.parse().map_err(|e| format!("`{cell}`: {e}"))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    fn read_text(text: &str) -> Result<Poses, PosesError> {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(text.as_bytes()).unwrap();
        read(file.path())
    }

    #[test]
    fn reads_poses_with_and_without_time() {
        let text = "time,x,y,z,a,b,c,d\n0,1,2,3,0,0,0,1\n\n1,4,5,6,1,0,0,0\n";
        let poses = read_text(text).unwrap().poses;
        assert_eq!(poses.len(), 2);
        assert_eq!(poses[1].translation.vector, nalgebra::Vector3::new(4.0, 5.0, 6.0));
        assert_eq!(read_text("1,2,3,0,0,0,1").unwrap().poses[0], poses[0]);
    }

    #[test]
    fn reads_what_other_programs_write() {
        let wanted = read_text("1,2,3,0,0,0.6,0.8").unwrap();
        assert_eq!(wanted.notes, Vec::<String>::new());
        for text in [
            "# timestamp tx ty tz qx qy qz qw\n0.0 1 2 3 0 0 0.6 0.8\n",
            "# exported\n\"t\",\"x\",\"y\",\"z\",\"qx\",\"qy\",\"qz\",\"qw\"\n0,1,2,3,0,0,0.6,0.8\n",
            "qw;qx;qy;qz;x [m];y [m];z [m]\n0.8;0;0;0.6;1;2;3\n",
            "field.position.x,field.position.y\nposition.x,position.y,position.z,orientation.x,\
             orientation.y,orientation.z,orientation.w\n1,2,3,0,0,0.6,0.8\n",
            "0\t1\t2\t3\t0\t0\t0.6\t0.8\n",
        ] {
            assert_eq!(read_text(text).unwrap(), wanted, "{text}");
        }
        let rounded = read_text("1,2,3,0,0,0.61,0.8\n1,2,3,0,0,0,1\n").unwrap();
        assert!((rounded.poses[0].rotation.norm() - 1.0).abs() < 1e-12);
        assert!(rounded.notes[0].contains("1 quaternions normalised"), "{:?}", rounded.notes);
        assert!(rounded.notes[0].ends_with("it is 1.0060 in line 1"), "{:?}", rounded.notes);
    }

    #[test]
    fn reported_pose_lists_are_read() {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/reports"));
        if !folder.is_dir() {
            eprintln!("skipped: the test data {} is not here", folder.display());
            return;
        }
        for (file, notes) in [("tum_space.txt", 0), ("round2.csv", 1), ("header2.csv", 0)] {
            let read = read(&folder.join(file)).unwrap();
            assert_eq!((read.poses.len(), read.notes.len()), (209, notes), "{file}");
        }
    }

    #[test]
    fn says_which_line_is_broken() {
        for (text, line) in [
            ("0,1,2,3,0,0,0,1\n0,1,2", 2),
            ("0,1,2,3,0,0,0,2", 1),
            ("1,2,3,0,0,0,nan", 1),
            ("h\n1,2,3,0,0,0,x", 2),
            ("# poses\nx [mm],y [mm],z [mm],qx,qy,qz,qw\n1000,0,0,0,0,0,1", 2),
        ] {
            match read_text(text) {
                Err(PosesError::Line { line: found, .. }) => assert_eq!(found, line, "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
        assert!(matches!(read_text("a,b\n"), Err(PosesError::Empty { .. })));
    }
}
