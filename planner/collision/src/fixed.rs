//! The shapes that the arm does not move, prepared for the fast check.

use nalgebra::Vector3;
use parry3d_f64::shape::SharedShape;

use crate::frame::Frame;
use crate::solid::Solid;

/// A shape that stands still in the root frame.
pub(crate) struct Fixed {
    pub(crate) place: Frame,
    pub(crate) solid: Solid,
    pub(crate) shape: SharedShape,
    /// Axis-aligned bounds in the root frame. \[m\]
    pub(crate) min: Vector3<f64>,
    pub(crate) max: Vector3<f64>,
    /// Distance to keep. \[m\]
    pub(crate) margin: f64,
}

impl Fixed {
    pub(crate) fn new(solid: &Solid, shape: &SharedShape, place: Frame, margin: f64) -> Self {
        let (low, high) = solid.bounds();
        let (min, max) = if low.iter().chain(&high).all(|x| x.is_finite()) {
            let centre = place.apply(&(0.5 * (low + high)));
            let half = place.rotation.abs() * (0.5 * (high - low));
            (centre - half, centre + half)
        } else {
            (Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY))
        };
        Self { place, solid: solid.clone(), shape: shape.clone(), min, max, margin }
    }

    /// Squared distance from a point of the root frame to the axis-aligned bounds. \[m²\]
    #[inline]
    pub(crate) fn box_distance_squared(&self, p: &Vector3<f64>) -> f64 {
        let outside = |i: usize| (self.min[i] - p[i]).max(p[i] - self.max[i]).max(0.0);
        let (x, y, z) = (outside(0), outside(1), outside(2));
        x * x + y * y + z * z
    }
}
