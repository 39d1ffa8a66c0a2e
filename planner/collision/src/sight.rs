//! Solid things as what hides what is behind them.

use nalgebra::Point3;
use parry3d_f64::math::{Pose, Vec3};
use parry3d_f64::query::Ray;
use parry3d_f64::shape::SharedShape;

use crate::error::CollisionError;
use crate::mesh::MeshPaths;
use crate::obstacle::Obstacle;
use crate::shapes::pose;

/// Solid things that may stand between two points.
pub struct Solids(Vec<(SharedShape, Pose)>);

impl Solids {
    /// The obstacles, in their frame.
    ///
    /// # Errors
    /// A mesh of one cannot be used, or its pieces are flat.
    pub fn new(obstacles: &[Obstacle], meshes: &MeshPaths) -> Result<Self, CollisionError> {
        let mut solids = Vec::new();
        for obstacle in obstacles {
            let (shapes, at) = obstacle.solids(meshes)?;
            solids.extend(shapes.iter().map(|shape| (shape.to_parry(), pose(&at))));
        }
        Ok(Self(solids))
    }

    /// Whether one of them is between two points, the last `spare` \[m\] before the second left out.
    #[must_use]
    pub fn hide(&self, from: &Point3<f64>, to: &Point3<f64>, spare: f64) -> bool {
        let way = to - from;
        let length = way.norm();
        if length <= spare {
            return false;
        }
        let way = way / length;
        let ray = Ray::new(Vec3::new(from.x, from.y, from.z), Vec3::new(way.x, way.y, way.z));
        self.0.iter().any(|(shape, at)| shape.intersects_ray(at, &ray, length - spare))
    }
}

impl std::fmt::Debug for Solids {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Solids").field(&self.0.len()).finish()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Vector3};
    use nullsweep_robot::Geometry;

    use super::*;

    #[test]
    fn a_box_hides_what_is_behind_it_and_nothing_beside_it() {
        let shape = Geometry::Box { half_extents: Vector3::new(0.1, 0.1, 0.01) }.into();
        let at = Isometry3::translation(0.0, 0.0, 0.5);
        let shelf = Obstacle { name: "shelf".into(), shape, pose: at, carries_robot: false };
        let solids = Solids::new(&[shelf], &MeshPaths::default()).expect("a box");
        let (eye, hidden) = (Point3::new(0.0, 0.0, 1.0), Point3::origin());
        assert!(solids.hide(&eye, &hidden, 0.0) && solids.hide(&hidden, &eye, 0.0));
        assert!(!solids.hide(&eye, &Point3::new(0.5, 0.0, 0.0), 0.0));
        // Up to its top, and what lies on it.
        let top = Point3::new(0.0, 0.0, 0.51);
        assert!(!solids.hide(&eye, &top, 0.005));
    }
}
