//! Scans: files of points or meshes become cleaned points with normals in the floor frame.
//!
//! The way through this folder: [`read`] parses a file into a [`RawScan`] in the file's own frame
//! (a depth camera's optical frame: x right, y down, z forward, sensor at the origin), [`place`]
//! moves it into the floor frame (z up, floor at z = 0), and [`clean()`] merges, filters and
//! smooths it into a [`Scan`], the only form in which the later stages see a surface. Several
//! views are placed apart and joined with [`PlacedScan::join`] before cleaning.
//!
//! A file is untrusted. Whatever its bytes, `read` returns points or a [`ScanError`] that names
//! the file, the line or byte and the cause; it never allocates from a count in a header.

mod clean;
mod error;
mod mesh;
mod normals;
mod pcd;
mod place;
mod ply;
mod read;
mod region;
mod text;

use nalgebra::{Isometry3, Point3, UnitVector3};

pub use clean::{CleanConfig, CleanReport, clean};
pub use error::{Place, ScanError, ScanWarning};
pub use place::{CropBox, PlacedScan, Placement, View, place};
pub use read::{Format, RawScan, ReadOptions, read, read_bytes};
pub use region::{Region, clean_region};

/// A cleaned surface: points with unit normals in one frame.
///
/// The three lists run parallel.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Points on the smoothed surface. \[m\]
    pub points: Vec<Point3<f64>>,
    /// Outward unit normals of `points`.
    pub normals: Vec<UnitVector3<f64>>,
    /// What the sensor measured for each of `points`: before smoothing, the mean of the
    /// measurements within the voxel. \[m\]
    pub raw: Vec<Point3<f64>>,
    /// Median distance from a point to its nearest neighbour. \[m\]
    pub spacing: f64,
}

impl Scan {
    /// The scan seen from another frame: every point moved by `pose`.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        Self {
            points: self.points.iter().map(|p| pose * p).collect(),
            normals: self.normals.iter().map(|n| pose.rotation * n).collect(),
            raw: self.raw.iter().map(|p| pose * p).collect(),
            spacing: self.spacing,
        }
    }

    /// The points inside a box, with the box in the scan's own frame.
    #[must_use]
    pub fn cropped(&self, region: &CropBox) -> Self {
        let kept: Vec<usize> =
            (0..self.points.len()).filter(|&i| region.contains(&self.points[i])).collect();
        Self {
            points: kept.iter().map(|&i| self.points[i]).collect(),
            normals: kept.iter().map(|&i| self.normals[i]).collect(),
            raw: kept.iter().map(|&i| self.raw[i]).collect(),
            spacing: self.spacing,
        }
    }
}
