//! Reading tool poses and tool paths.

mod found;
mod gcode;
mod quaternion;
mod table;
mod tree;

use std::path::Path;

use nalgebra::Isometry3;

pub use found::{Poses, PosesError};
pub use quaternion::QuaternionOrder;

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
