//! A flat part of a room.

use nalgebra::{Point3, UnitVector3};

use super::outline::{self, Rectangle};

/// What a plane is to whoever moves in the room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaneKind {
    /// The lowest level plane: everything stands on it.
    Floor,
    /// A level plane above it.
    Table,
    /// An upright plane with nothing behind it.
    Wall,
}

/// A flat part of the room, as far as it was seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// The middle of what was seen. \[m\]
    pub point: Point3<f64>,
    /// Upwards, or away from the wall into the room.
    pub normal: UnitVector3<f64>,
    /// Corners of the convex hull of what was seen, counter-clockwise about the normal. \[m\]
    pub outline: Vec<Point3<f64>>,
    /// How much was seen, holes left out. \[m²\]
    pub area: f64,
    /// Floor, table or wall.
    pub kind: PlaneKind,
}

impl Plane {
    /// The smallest rectangle around the outline.
    #[must_use]
    pub fn rectangle(&self) -> Rectangle {
        Rectangle::around(&self.outline, &self.point, &self.normal)
    }

    /// Whether a point lies in the plane to within a tolerance, inside the outline unless it is the
    /// floor, which goes on.
    pub(super) fn holds(&self, point: &Point3<f64>, tolerance: f64) -> bool {
        (point - self.point).dot(&self.normal).abs() <= tolerance
            && (self.kind == PlaneKind::Floor
                || outline::contains(&self.outline, &self.normal, point, tolerance))
    }
}
