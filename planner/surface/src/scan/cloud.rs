//! The cleaned scan.

use nalgebra::{Isometry3, Point3, UnitVector3};

use super::crop::CropBox;

/// The fewest points of which a surface can be made.
pub(super) const MIN_POINTS: usize = 15;

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
        let inside = |&i: &u32| region.contains(&self.points[i as usize]);
        let kept: Vec<u32> = (0..self.points.len() as u32).filter(inside).collect();
        self.of(&kept)
    }

    /// Some of its points, by their indices.
    #[must_use]
    pub fn of(&self, kept: &[u32]) -> Self {
        Self {
            points: kept.iter().map(|&i| self.points[i as usize]).collect(),
            normals: kept.iter().map(|&i| self.normals[i as usize]).collect(),
            raw: kept.iter().map(|&i| self.raw[i as usize]).collect(),
            spacing: self.spacing,
        }
    }
}
