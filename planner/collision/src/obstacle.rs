//! What stands around the robot besides the scan.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::Geometry;

use crate::error::CollisionError;
use crate::mesh::{Hull, MeshPaths};
use crate::solid::Solid;

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
    /// The convex hulls of some points each, together.
    Hulls(Vec<Vec<Point3<f64>>>),
    /// All that is below the plane z = 0: a floor.
    Floor,
}

impl Obstacle {
    /// Its convex pieces, and the pose that they stand at in the root frame.
    pub(crate) fn solids(
        &self,
        meshes: &MeshPaths,
    ) -> Result<(Vec<Solid>, Isometry3<f64>), CollisionError> {
        let name = || self.name.clone();
        match &self.shape {
            ObstacleShape::Floor => Ok((vec![Solid::HalfSpace], self.pose)),
            ObstacleShape::Hulls(hulls) => {
                let hull = |points: &Vec<_>| Hull::new(points).map(|hull| Solid::Hull(hull.into()));
                let solids: Option<Vec<Solid>> = hulls.iter().map(hull).collect();
                let flat = || CollisionError::FlatObstacle { obstacle: name() };
                Ok((solids.ok_or_else(flat)?, self.pose))
            }
            ObstacleShape::Geometry(geometry) => {
                let error = |error| CollisionError::ObstacleMesh { obstacle: name(), error };
                let found = Solid::prepare(geometry, self.pose, meshes).map_err(error)?;
                Ok((found.solids, found.pose))
            }
        }
    }

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
