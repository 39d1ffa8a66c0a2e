//! Reading tool poses and tool paths.

mod gcode;
mod quaternion;
mod table;
mod tree;

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

pub use quaternion::QuaternionOrder;

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
    /// A line is no pose, or no motion that can be followed.
    #[error("{}, line {line}: {what}; wanted is {wanted}", path.display())]
    Line {
        /// Which file.
        path: PathBuf,
        /// Counted from 1.
        line: usize,
        /// What is wrong.
        what: String,
        /// What is right.
        wanted: &'static str,
    },
    /// The file is no YAML or JSON.
    #[error("{}: {what}", path.display())]
    Syntax {
        /// Which file.
        path: PathBuf,
        /// What the parser says, with line and column.
        what: String,
    },
    /// Something that stands for a pose is none.
    #[error("{}, {place}: {what}", path.display())]
    Pose {
        /// Which file.
        path: PathBuf,
        /// Which pose, by the names and numbers that lead to it.
        place: String,
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

/// How a file is to be understood.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Order of quaternions where no names tell it; `None`: the scalar last, which is noted.
    pub order: Option<QuaternionOrder>,
    /// The file's frame in the robot's root frame: a work offset.
    pub offset: Isometry3<f64>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { order: None, offset: Isometry3::identity() }
    }
}

/// Poses from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// Of the tool in the robot's root frame, in pieces that are gone through without leaving off; none
    /// is empty. \[m\]
    pub segments: Vec<Vec<Isometry3<f64>>>,
    /// What had to be mended or guessed, in words.
    pub notes: Vec<String>,
}

impl Poses {
    /// All of them, one after the other.
    #[must_use]
    pub fn all(&self) -> Vec<Isometry3<f64>> {
        self.segments.concat()
    }
}

/// Endings of files with G-code.
const GCODE: [&str; 8] = ["gcode", "nc", "ngc", "cnc", "tap", "gc", "g", "mpf"];

/// Reads poses of the tool.
///
/// By its name a file is YAML or JSON (poses with `position` and `orientation`, as geometry_msgs has
/// them, or with x, y, z, qw, qx, qy, qz, as noether writes them, in lists of any depth: an innermost
/// list is a segment), or G-code; else it is a table: numbers apart by commas, semicolons, tabs or
/// blanks, seven a line (position \[m\], unit quaternion), or eight with a time before them, which is
/// not looked at. Names in a line before the poses, or in a comment there, decide which column is
/// which. A quaternion whose length is within 2 % of 1 is normalised, which is noted.
///
/// # Errors
/// Names the file and the line, or the pose.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Poses, PosesError> {
    let bytes =
        std::fs::read(path).map_err(|source| PosesError::File { path: path.into(), source })?;
    let text = String::from_utf8_lossy(&bytes);
    let text = text.trim_start_matches('\u{feff}');
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let mut poses = match ending.as_str() {
        "json" => tree::read(text, tree::Syntax::Json, path, options.order)?,
        "yaml" | "yml" => tree::read(text, tree::Syntax::Yaml, path, options.order)?,
        gcode if GCODE.contains(&gcode) => gcode::read(text, path)?,
        _ => table::read(text, path, options.order)?,
    };
    poses.segments.retain(|segment| !segment.is_empty());
    if poses.segments.is_empty() {
        return Err(PosesError::Empty { path: path.into() });
    }
    for pose in poses.segments.iter_mut().flatten() {
        *pose = options.offset * *pose;
    }
    Ok(poses)
}
