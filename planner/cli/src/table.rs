//! The table under an object.

use std::str::FromStr;

use nalgebra::{Isometry3, Point3};
use nullsweep_collision::Obstacle;
use nullsweep_planner::progress::Progress;
use nullsweep_robot::Geometry;
use nullsweep_surface::Scan;

use crate::bars::Bars;
use crate::numbers::positive;

/// Thickness of a table top. [m]
pub(super) const TABLE_TOP: f64 = 0.03;
/// How far a table top of unknown size is taken to reach beyond the object. [m]
const TABLE_RIM: f64 = 0.45;

/// Length and width of a table top. [m]
#[derive(Clone, Copy, Debug)]
pub(super) struct TableSize([f64; 2]);

impl FromStr for TableSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (length, width) = text.split_once('x').ok_or("LxW is wanted, 1.2x0.8 say")?;
        let side = |text: &str| positive(text.trim()).map_err(|e| format!("`{text}`: {e}"));
        Ok(Self([side(length)?, side(width)?]))
    }
}

/// A table top under the scan, at a height \[m\]; one of unknown size is told.
pub(super) fn under(scan: &Scan, height: f64, size: Option<TableSize>, bars: &Bars) -> Obstacle {
    if size.is_none() {
        bars.note(&format!(
            "the table is taken to reach {TABLE_RIM} m beyond the object on every side: --table LxW \
             gives its size"
        ));
    }
    let mut low = Point3::new(f64::INFINITY, f64::INFINITY, height - TABLE_TOP);
    let mut high = Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, height);
    for p in &scan.points {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    for axis in 0..2 {
        let half = 0.5 * (high[axis] - low[axis]);
        let grow = size.map_or(TABLE_RIM, |TableSize(sides)| 0.5 * sides[axis] - half);
        low[axis] -= grow;
        high[axis] += grow;
    }
    Obstacle {
        name: "table".into(),
        shape: Geometry::Box { half_extents: (high - low) * 0.5 }.into(),
        pose: Isometry3::from(nalgebra::center(&low, &high).coords),
        carries_robot: false,
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use nullsweep_collision::ObstacleShape;

    use super::*;

    #[test]
    fn a_table_is_as_large_as_it_is_said_and_else_reaches_beyond_the_object() {
        let points = vec![Point3::new(0.9, 0.0, 0.75), Point3::new(1.1, 0.4, 0.8)];
        let normals = vec![Vector3::z_axis(); 2];
        let scan = Scan { raw: points.clone(), points, normals, spacing: 0.01 };
        for (size, sides) in [(Some("1.2x0.8"), [1.2, 0.8]), (None, [1.1, 1.3])] {
            let size = size.map(|text| text.parse().expect("a size"));
            let table = under(&scan, 0.7, size, &Bars::new());
            let ObstacleShape::Geometry(Geometry::Box { half_extents }) = table.shape else {
                panic!("a box")
            };
            let wanted = 0.5 * Vector3::new(sides[0], sides[1], TABLE_TOP);
            assert!((half_extents - wanted).norm() < 1e-12, "{half_extents}");
            let middle = table.pose.translation.vector;
            let top = Vector3::new(1.0, 0.2, 0.7 - 0.5 * TABLE_TOP);
            assert!((middle - top).norm() < 1e-12, "{middle}");
        }
        for wrong in ["1.2", "0x1", "1x-1", "nanx1", "1x"] {
            assert!(wrong.parse::<TableSize>().is_err(), "{wrong}");
        }
    }
}
