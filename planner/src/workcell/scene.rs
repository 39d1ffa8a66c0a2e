//! What is there: the surface to sweep and all that is in the way.

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::Obstacle;
use nullsweep_surface::{Region, Scan};

/// The surface to sweep and what is around it, in one frame: the floor frame where it is
/// given.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The scanned surface that is to be swept.
    pub surface: Scan,
    /// Points that were scanned but are not to be swept. \[m\]
    pub surroundings: Vec<Point3<f64>>,
    /// Solid things besides the scan.
    pub obstacles: Vec<Obstacle>,
}

impl Scene {
    /// A surface that stands on the floor, nothing else around it.
    #[must_use]
    pub fn on_floor(surface: Scan) -> Self {
        let obstacles = vec![Obstacle::floor(Isometry3::identity())];
        Self { surface, surroundings: Vec::new(), obstacles }
    }

    /// Nothing scanned, only solid things.
    #[must_use]
    pub fn of_obstacles(obstacles: Vec<Obstacle>) -> Self {
        let (points, normals, raw) = (Vec::new(), Vec::new(), Vec::new());
        let surface = Scan { points, normals, raw, spacing: 0.0 };
        Self { surface, surroundings: Vec::new(), obstacles }
    }

    /// The scene seen from another frame: everything moved by `pose`.
    #[must_use]
    pub fn transformed(&self, pose: &Isometry3<f64>) -> Self {
        let moved = |o: &Obstacle| Obstacle { pose: pose * o.pose, ..o.clone() };
        Self {
            surface: self.surface.transformed(pose),
            surroundings: self.surroundings.iter().map(|p| pose * p).collect(),
            obstacles: self.obstacles.iter().map(moved).collect(),
        }
    }

    /// All scanned points: those of the surface, then the others. \[m\]
    #[must_use]
    pub fn points(&self) -> Vec<Point3<f64>> {
        self.surface.points.iter().chain(&self.surroundings).copied().collect()
    }
}

impl From<Region> for Scene {
    /// A part of a scan that is to be swept, the rest in the way, on the floor.
    fn from(region: Region) -> Self {
        Self { surroundings: region.surroundings, ..Self::on_floor(region.surface) }
    }
}
