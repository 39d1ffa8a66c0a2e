//! A task's list of poses, and what the command line takes as numbers.

use nullsweep_planner::task::{self, Tolerance};
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
    let Ok(poses) = file::with(bytes, task::read) else { return false };
    for pose in &poses.poses {
        assert!(pose.translation.vector.iter().all(|x| x.is_finite()));
        assert!((pose.rotation.quaternion().norm() - 1.0).abs() < 1e-9);
    }
    !poses.poses.is_empty()
}
