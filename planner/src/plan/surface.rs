//! The surface that a plan is to sweep.

use nalgebra::{Point3, UnitVector3};
use nullsweep_surface::Scan;

use super::file::Plan;

impl Plan {
    /// The scanned points that it is to sweep, in the root frame, as far as a plan keeps them: without
    /// the raw measurements, and without their spacing.
    #[must_use]
    pub fn scan(&self) -> Scan {
        let points: Vec<Point3<f64>> = self.surface.iter().map(|s| s.point.into()).collect();
        let normal = |n: [f64; 3]| UnitVector3::new_normalize(n.into());
        let normals = self.surface.iter().map(|s| normal(s.normal)).collect();
        Scan { raw: points.clone(), points, normals, spacing: 0.0 }
    }

    /// Whether it goes through given poses: what it keeps as its surface are their places, one each.
    #[must_use]
    pub fn is_of_poses(&self) -> bool {
        let places = self.surface.iter().map(|s| s.point);
        !self.surface.is_empty() && places.eq(self.patches.iter().copied())
    }
}
