//! A table of poses: a line each.

use std::path::Path;

use nalgebra::Isometry3;

use super::found::{Poses, PosesError};
use super::quaternion::{QuaternionOrder, Quaternions, isometry};

/// What is wanted of a line.
const WANTED: &str = "one pose a line: time,x,y,z,qx,qy,qz,qw or x,y,z,qx,qy,qz,qw";

/// Which column is what, from 0.
#[derive(Clone, Copy, Debug)]
struct Columns {
    /// x, y, z, qx, qy, qz, qw.
    pose: [usize; 7],
    /// Whose change begins another segment.
    segment: Option<usize>,
}

/// Poses from numbers apart by commas, semicolons, tabs or blanks: seven a line, or eight with a time
/// before them, which is not looked at. Names in a line before the poses, or in a comment there, decide
/// which column is which, and whether there is one of segments; a position in another unit than metres
/// is refused.
pub(super) fn read(
    text: &str,
    path: &Path,
    order: Option<QuaternionOrder>,
) -> Result<Poses, PosesError> {
    let (mut segments, mut last) = (Vec::<Vec<Isometry3<f64>>>::new(), None::<String>);
    let (mut columns, mut told) = (None::<Columns>, order);
    let mut quaternions = Quaternions::default();
    for (k, line) in text.lines().enumerate() {
        let comment = ["#", "//", "%"].iter().any(|mark| line.trim_start().starts_with(mark));
        let cells = cells(line.trim_start_matches(['#', '/', '%', ' ']));
        let at = |what| PosesError::Line { path: path.into(), line: k + 1, what, wanted: WANTED };
        if cells.is_empty() || comment || segments.is_empty() && is_heading(&cells) {
            if segments.is_empty() {
                if let Some(named) = named(&cells) {
                    in_metres(&cells, &named.pose).map_err(at)?;
                    columns = Some(named);
                }
                told = told.or_else(|| order_in(line));
            }
            continue;
        }
        let order = told.unwrap_or(QuaternionOrder::Xyzw);
        let (pose, length) = pose(&cells, columns.as_ref(), order).map_err(at)?;
        quaternions.see(length, || format!("line {}", k + 1));
        let own = columns.and_then(|c| cells.get(c.segment?)).map(|cell| (*cell).to_owned());
        match segments.last_mut().filter(|_| own == last) {
            Some(segment) => segment.push(pose),
            None => segments.push(vec![pose]),
        }
        last = own;
    }
    let file = path.display();
    let guessed = columns.is_none() && told.is_none() && !segments.is_empty();
    let guess = guessed.then(|| {
        format!(
            "{file}: no names tell which column is which: quaternions are taken for x, y, z, w; --quat \
             wxyz where w is first"
        )
    });
    let notes = guess.into_iter().chain(quaternions.note(&file.to_string())).collect();
    Ok(Poses { segments, notes })
}

/// Whether a line before the poses holds names, or the numbers of columns behind the empty cell that
/// stands above a table's index.
fn is_heading(cells: &[&str]) -> bool {
    let numbered = || {
        let count = |(k, cell): (usize, &&str)| cell.parse() == Ok(k);
        cells.len() > 2 && cells[0].is_empty() && cells[1..].iter().enumerate().all(count)
    };
    cells.iter().all(|cell| cell.parse::<f64>().is_err()) || numbered()
}

/// The order of quaternions that a line of words tells.
fn order_in(line: &str) -> Option<QuaternionOrder> {
    let plain: String = line.chars().filter(|c| c.is_alphanumeric()).collect();
    let plain = plain.to_lowercase();
    if plain.contains("wxyz") || plain.contains("qwqxqyqz") {
        Some(QuaternionOrder::Wxyz)
    } else if plain.contains("xyzw") || plain.contains("qxqyqzqw") {
        Some(QuaternionOrder::Xyzw)
    } else {
        None
    }
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
fn named(names: &[&str]) -> Option<Columns> {
    const NAMES: [&[&str]; 7] = [
        &["x", "px", "tx", "positionx", "posx", "translationx"],
        &["y", "py", "ty", "positiony", "posy", "translationy"],
        &["z", "pz", "tz", "positionz", "posz", "translationz"],
        &["qx", "orientationx", "rotationx", "rotx", "quatx", "quaternionx"],
        &["qy", "orientationy", "rotationy", "roty", "quaty", "quaterniony"],
        &["qz", "orientationz", "rotationz", "rotz", "quatz", "quaternionz"],
        &["qw", "orientationw", "rotationw", "rotw", "quatw", "quaternionw"],
    ];
    const SEGMENT: [&str; 4] = ["segment", "stroke", "raster", "pass"];
    let plain = |name: &str| {
        let name = name.split(['[', '(']).next().unwrap_or(name);
        let plain: String = name.chars().filter(|c| c.is_alphanumeric()).collect();
        plain.to_lowercase().trim_start_matches("target").to_owned()
    };
    let names: Vec<String> = names.iter().map(|name| plain(name)).collect();
    let mut pose = [0; 7];
    for (column, wanted) in pose.iter_mut().zip(NAMES) {
        *column = names.iter().position(|name| wanted.contains(&name.as_str()))?;
    }
    let segment = names.iter().position(|name| SEGMENT.contains(&name.as_str()));
    Some(Columns { pose, segment })
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
fn pose(
    cells: &[&str],
    columns: Option<&Columns>,
    order: QuaternionOrder,
) -> Result<(Isometry3<f64>, f64), String> {
    if let Some(columns) = columns {
        let cell = |&i: &usize| cells.get(i).ok_or(format!("{} cells", cells.len()));
        let numbers: Vec<f64> =
            columns.pose.iter().map(|i| number(cell(i)?)).collect::<Result<_, _>>()?;
        return isometry(
            [numbers[0], numbers[1], numbers[2]],
            [numbers[3], numbers[4], numbers[5], numbers[6]],
        );
    }
    let numbers: Vec<f64> = cells.iter().map(|cell| number(cell)).collect::<Result<_, _>>()?;
    let [x, y, z, a, b, c, d] = match numbers.as_slice() {
        [_, rest @ ..] if rest.len() == 7 => rest,
        rest => rest,
    }
    .try_into()
    .map_err(|_| format!("{} numbers", numbers.len()))?;
    if !numbers.iter().all(|n| n.is_finite()) {
        return Err("a number is not finite".into());
    }
    isometry([x, y, z], order.xyzw([a, b, c, d]))
}

fn number(cell: &str) -> Result<f64, String> {
    cell.parse().map_err(|e| format!("`{cell}`: {e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Poses, PosesError> {
        read(text.trim_start_matches('\u{feff}'), Path::new("poses.csv"), Some(XYZW))
    }

    const XYZW: QuaternionOrder = QuaternionOrder::Xyzw;

    #[test]
    fn reads_poses_with_and_without_time() {
        let text = "time,x,y,z,a,b,c,d\n0,1,2,3,0,0,0,1\n\n1,4,5,6,1,0,0,0\n";
        let poses = read_text(text).unwrap().segments.concat();
        assert_eq!(poses.len(), 2);
        assert_eq!(poses[1].translation.vector, nalgebra::Vector3::new(4.0, 5.0, 6.0));
        assert_eq!(read_text("1,2,3,0,0,0,1").unwrap().segments[0][0], poses[0]);
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
            "time,target-POS_X,target-POS_Y,target-POS_Z,target-ROT_X,target-ROT_Y,target-ROT_Z,\
             target-ROT_W\n0,1,2,3,0,0,0.6,0.8\n",
        ] {
            assert_eq!(read_text(text).unwrap(), wanted, "{text}");
        }
        let rounded = read_text("1,2,3,0,0,0.61,0.8\n1,2,3,0,0,0,1\n").unwrap();
        assert!((rounded.segments[0][0].rotation.norm() - 1.0).abs() < 1e-12);
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
            let text = std::fs::read_to_string(folder.join(file)).unwrap();
            let read = read(&text, Path::new(file), Some(XYZW)).unwrap();
            assert_eq!((read.segments.concat().len(), read.notes.len()), (209, notes), "{file}");
        }
    }

    #[test]
    fn the_scalar_is_first_where_names_or_words_say_so() {
        let wanted = read_text("1,2,3,0,0,0.6,0.8").unwrap().segments;
        let auto = |text: &str| read(text, Path::new("poses.csv"), None).unwrap();
        for text in [
            "time,x,y,z,qw,qx,qy,qz\n0,1,2,3,0.8,0,0,0.6\n",
            "# position, then quaternion (w, x, y, z)\n1 2 3 0.8 0 0 0.6\n",
            "# wxyz\n0 1 2 3 0.8 0 0 0.6\n",
        ] {
            assert_eq!(
                (auto(text).segments, auto(text).notes.len()),
                (wanted.clone(), 0),
                "{text}"
            );
        }
        let wxyz = Some(QuaternionOrder::Wxyz);
        // A table with an index, its columns numbered.
        let indexed = ",0,1,2,3,4,5,6\n0,1,2,3,0.8,0,0,0.6\n1,1,2,3,0.8,0,0,0.6\n";
        let poses = read(indexed, Path::new("poses.csv"), wxyz).unwrap();
        assert_eq!(poses.segments.concat(), [wanted[0][0], wanted[0][0]]);
        assert!(auto(indexed).notes[0].contains("--quat wxyz"), "{:?}", auto(indexed).notes);
    }

    #[test]
    fn a_column_of_segments_parts_them() {
        let text = "segment,x,y,z,qx,qy,qz,qw\na,1,0,0,0,0,0,1\na,2,0,0,0,0,0,1\nb,3,0,0,0,0,0,1\n";
        let lengths: Vec<usize> = read_text(text).unwrap().segments.iter().map(Vec::len).collect();
        assert_eq!(lengths, [2, 1]);
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
        assert_eq!(read_text("a,b\n").unwrap().segments, Vec::<Vec<Isometry3<f64>>>::new());
    }
}
