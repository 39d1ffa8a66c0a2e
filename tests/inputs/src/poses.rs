//! Tool poses and tool paths, and what the command line takes as numbers.

use std::path::Path;

use nullsweep_planner::poses::{self, ReadOptions, Tolerance};
use nullsweep_surface::CropBox;

use crate::file;

pub(crate) fn run(bytes: &[u8]) -> bool {
    if let Ok(text) = std::str::from_utf8(bytes) {
        if let Ok(Tolerance(values)) = text.trim().parse() {
            assert!(values.iter().all(|v| *v >= 0.0));
        }
        if let Ok(CropBox { min, max }) = text.trim().parse() {
            assert!((0..3).all(|axis| min[axis] < max[axis]));
        }
    }
    let endings = ["csv", "yaml", "json", "nc"];
    endings.into_iter().fold(false, |taken, ending| taken | is_read(bytes, ending))
}

/// Whether the bytes are taken as a file with this ending.
fn is_read(bytes: &[u8], ending: &str) -> bool {
    let read = |path: &Path| poses::read(path, &ReadOptions::default());
    let Ok(poses) = file::with_ending(bytes, ending, read) else { return false };
    assert!(poses.segments.iter().all(|segment| !segment.is_empty()));
    for pose in poses.segments.iter().flatten() {
        assert!(pose.translation.vector.iter().all(|x| x.is_finite()));
        assert!((pose.rotation.quaternion().norm() - 1.0).abs() < 1e-9);
    }
    !poses.segments.is_empty()
}
