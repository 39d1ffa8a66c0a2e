//! The table under an object.

use std::str::FromStr;

use nalgebra::{Isometry3, Point3, UnitVector3};
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
/// A point of the surface this near to the table's height may be of its top. [m]
const TOP_NOISE: f64 = 0.02;
/// Least z of the normal of a level surface.
const LEVEL: f64 = 0.9;
/// Share of what is swept from which on the table's top is a part of it: more than what is left of it
/// where an object was cut out.
const TOP_SHARE: f64 = 0.25;
/// How far below the points of a swept top the solid plate begins: more than a pad is pressed in and
/// the arm keeps from it, as deep as something may come behind what was measured. [m]
const BELOW: f64 = 0.02;
/// The same beside what was measured, where no points keep the arm off the top: no more than a pad
/// that hangs over is pressed in, and keeps from a solid thing. [m]
const BESIDE: f64 = 0.01;

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

/// The table top under the scan, at a height \[m\]; one of unknown size is told. Where its top is
/// itself what is swept, the measured points stand for it there: the plate lies below them, and told.
pub(super) fn under(
    scan: &Scan,
    height: f64,
    size: Option<TableSize>,
    bars: &Bars,
) -> Vec<Obstacle> {
    if size.is_none() {
        bars.note(&format!(
            "the table is taken to reach {TABLE_RIM} m beyond the object on every side: --table LxW \
             gives its size"
        ));
    }
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in &scan.points {
        for axis in 0..2 {
            low[axis] = low[axis].min(p[axis]);
            high[axis] = high[axis].max(p[axis]);
        }
    }
    let seen = [low, high];
    for axis in 0..2 {
        let half = 0.5 * (high[axis] - low[axis]);
        let grow = size.map_or(TABLE_RIM, |TableSize(sides)| 0.5 * sides[axis] - half);
        low[axis] -= grow;
        high[axis] += grow;
    }
    let Some(lowest) = swept_top(scan, height) else { return vec![plate(low, high, height)] };
    let below = lowest - BELOW;
    let beside = lowest - BESIDE;
    bars.note(&format!(
        "what is swept is the table's top: its points stand for it, and what is solid below them \
         begins at {below:.3} m, beside them at {beside:.3} m"
    ));
    let [from, to] = seen;
    let rim = [
        (low, [from[0], high[1]]),
        ([to[0], low[1]], high),
        ([from[0], low[1]], [to[0], from[1]]),
        ([from[0], to[1]], [to[0], high[1]]),
    ];
    let rim = rim.into_iter().filter(|(low, high)| (0..2).all(|axis| high[axis] > low[axis]));
    let rim = rim.map(|(low, high)| plate(low, high, beside));
    std::iter::once(plate(low, high, below)).chain(rim).collect()
}

/// The lowest point of a table's top at a height, if it is a part of what is swept. \[m\]
fn swept_top(scan: &Scan, height: f64) -> Option<f64> {
    let of_top = |(p, n): &(&Point3<f64>, &UnitVector3<f64>)| {
        (p.z - height).abs() < TOP_NOISE && n.z > LEVEL
    };
    let of_top = scan.points.iter().zip(&scan.normals).filter(of_top).map(|(p, _)| p.z);
    let share = of_top.clone().count() as f64 / scan.points.len().max(1) as f64;
    (share > TOP_SHARE).then(|| of_top.fold(height, f64::min))
}

/// A plate of a table's thickness below a height.
fn plate(low: [f64; 2], high: [f64; 2], height: f64) -> Obstacle {
    let low = Point3::new(low[0], low[1], height - TABLE_TOP);
    let high = Point3::new(high[0], high[1], height);
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

    /// Half extents and middle.
    fn a_box(obstacle: &Obstacle) -> (Vector3<f64>, Vector3<f64>) {
        let ObstacleShape::Geometry(Geometry::Box { half_extents }) = obstacle.shape else {
            panic!("a box")
        };
        (half_extents, obstacle.pose.translation.vector)
    }

    #[test]
    fn a_table_lies_below_its_own_top_where_that_is_swept_and_hardly_below_it_beside() {
        let mut points: Vec<Point3<f64>> = (0..400)
            .map(|i| {
                let noise = 0.001 * f64::from(i % 7) - 0.003;
                Point3::new(0.02 * f64::from(i % 20), 0.02 * f64::from(i / 20), 0.7 + noise)
            })
            .collect();
        points.push(Point3::new(0.2, 0.2, 0.9));
        let normals = vec![Vector3::z_axis(); points.len()];
        let scan = Scan { raw: points.clone(), points, normals, spacing: 0.02 };
        let tables = under(&scan, 0.7, None, &Bars::new());
        let inside = |p: Point3<f64>| {
            tables.iter().any(|table| {
                let (half, middle) = a_box(table);
                (p.coords - middle).iter().zip(&half).all(|(off, half)| off.abs() <= *half)
            })
        };
        // Under the pad pressed in by 10 mm, and what it keeps beside that, there is nothing solid.
        for p in &scan.points {
            // At the border what lies beside it begins.
            let border = [p.x, p.y].iter().any(|at| *at < 1e-9 || *at > 0.38 - 1e-9);
            let pressed = if border { 0.0095 } else { 0.015 };
            assert!(!inside(Point3::new(p.x, p.y, 0.697 - pressed)), "under {p}");
            assert!(inside(Point3::new(p.x, p.y, 0.66)), "the plate is under {p}");
        }
        for beside in [[-0.4, 0.2], [0.8, 0.2], [0.2, -0.4], [0.2, 0.8], [-0.4, -0.4]] {
            assert!(inside(Point3::new(beside[0], beside[1], 0.686)), "{beside:?}");
            // A pad that hangs over is pressed in by 4 mm and keeps 5 mm.
            assert!(!inside(Point3::new(beside[0], beside[1], 0.697 - 0.0095)), "{beside:?}");
        }
    }

    #[test]
    fn a_table_is_as_large_as_it_is_said_and_else_reaches_beyond_the_object() {
        let points = vec![Point3::new(0.9, 0.0, 0.75), Point3::new(1.1, 0.4, 0.8)];
        let normals = vec![Vector3::z_axis(); 2];
        let scan = Scan { raw: points.clone(), points, normals, spacing: 0.01 };
        for (size, sides) in [(Some("1.2x0.8"), [1.2, 0.8]), (None, [1.1, 1.3])] {
            let size = size.map(|text| text.parse().expect("a size"));
            let tables = under(&scan, 0.7, size, &Bars::new());
            assert_eq!(tables.len(), 1, "the object stands on it, its top is not swept");
            let (half_extents, middle) = a_box(&tables[0]);
            let wanted = 0.5 * Vector3::new(sides[0], sides[1], TABLE_TOP);
            assert!((half_extents - wanted).norm() < 1e-12, "{half_extents}");
            let top = Vector3::new(1.0, 0.2, 0.7 - 0.5 * TABLE_TOP);
            assert!((middle - top).norm() < 1e-12, "{middle}");
        }
        for wrong in ["1.2", "0x1", "1x-1", "nanx1", "1x"] {
            assert!(wrong.parse::<TableSize>().is_err(), "{wrong}");
        }
    }
}
