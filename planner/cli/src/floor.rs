//! Scans in the floor frame, with what took them there.

use nalgebra::Isometry3;
use nullsweep_surface::PlacedScan;

/// Scans in the floor frame.
pub(super) struct Placed {
    pub(super) scan: PlacedScan,
    /// Of each file, what takes its coordinates there.
    pub(super) poses: Vec<Isometry3<f64>>,
    /// By which a scene file's planes and objects were found.
    pub(super) seed: Option<u64>,
}
