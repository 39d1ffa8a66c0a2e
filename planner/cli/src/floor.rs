//! Scans in the floor frame, with what took them there.

use std::path::PathBuf;

use nalgebra::Isometry3;
use nullsweep_surface::PlacedScan;

/// Where a view comes from.
pub(super) struct Source {
    pub(super) file: PathBuf,
    /// Factor from the file's unit to metres.
    pub(super) scale: f64,
    /// What takes the file's coordinates to the floor frame.
    pub(super) pose: Isometry3<f64>,
}

/// Scans in the floor frame.
pub(super) struct Placed {
    pub(super) scan: PlacedScan,
    /// The file of each view.
    pub(super) sources: Vec<Source>,
    /// The file of regions that a scene file names.
    pub(super) regions: Option<PathBuf>,
    /// By which a scene file's planes and objects were found.
    pub(super) seed: Option<u64>,
}
