//! What stands around the robot besides the scan.

use nalgebra::Isometry3;
use nullsweep_robot::Geometry;

/// Something to keep away from besides the scan.
#[derive(Clone, Debug)]
pub struct Obstacle {
    /// For people.
    pub name: String,
    /// Its shape about its own origin. \[m\]
    pub shape: ObstacleShape,
    /// Where it stands in the robot's root frame. \[m\]
    pub pose: Isometry3<f64>,
    /// The robot stands on it: only what moves with the arm is checked against it.
    pub carries_robot: bool,
}

/// The shape of an obstacle about its own origin. \[m\]
#[derive(Clone, Debug)]
pub enum ObstacleShape {
    /// A shape as a URDF describes it. A mesh is found, and stands for convex pieces, as those of
    /// the links are.
    Geometry(Geometry),
    /// All that is below the plane z = 0: a floor.
    Floor,
}

impl Obstacle {
    /// The floor z = 0 of a floor frame that stands at `pose` \[m\] in the root frame.
    #[must_use]
    pub fn floor(pose: Isometry3<f64>) -> Self {
        Self { name: "floor".into(), shape: ObstacleShape::Floor, pose, carries_robot: true }
    }
}

impl From<Geometry> for ObstacleShape {
    fn from(geometry: Geometry) -> Self {
        Self::Geometry(geometry)
    }
}
