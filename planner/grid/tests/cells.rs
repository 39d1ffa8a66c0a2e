//! Searches against a look at every point.

use nalgebra::Point3;
use nullsweep_grid::{Cells, Runs};
use proptest::prelude::*;

const SIDE: f64 = 0.25;

/// Coordinates on the cells' borders as well as anywhere.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![-1.0..1.0, (-4..=4).prop_map(|k| SIDE * f64::from(k))]
}

fn point() -> impl Strategy<Value = Point3<f64>> {
    [coordinate(), coordinate(), coordinate()].prop_map(Point3::from)
}

/// The points that the runs give, if each comes once and all lie within a cell of the box.
fn found(
    points: &[Point3<f64>],
    order: &[u32],
    runs: Runs<'_>,
    low: &Point3<f64>,
    high: &Point3<f64>,
) -> Result<Vec<bool>, TestCaseError> {
    let mut found = vec![false; points.len()];
    let mut end = 0;
    for run in runs {
        prop_assert!(end <= run.start && run.start <= run.end, "{run:?} after {end}");
        end = run.end;
        for &index in &order[run] {
            found[index as usize] = true;
            let p = points[index as usize];
            let near = |i: usize| p[i] > low[i] - 1.001 * SIDE && p[i] < high[i] + 1.001 * SIDE;
            prop_assert!((0..3).all(near), "{p} for {low} to {high}");
        }
    }
    Ok(found)
}

proptest! {
    #[test]
    fn the_order_has_every_point_once(points in prop::collection::vec(point(), 0..60)) {
        let (_, mut order) = Cells::new(&points, SIDE);
        order.sort_unstable();
        prop_assert!(order.into_iter().eq(0..points.len() as u32));
    }

    #[test]
    fn a_box_misses_no_point(
        points in prop::collection::vec(point(), 0..60),
        a in point(),
        b in point(),
    ) {
        let (cells, order) = Cells::new(&points, SIDE);
        let (low, high) = (a.inf(&b), a.sup(&b));
        let found = found(&points, &order, cells.between(&low, &high), &low, &high)?;
        for (p, found) in points.iter().zip(found) {
            prop_assert!(found || (0..3).any(|i| p[i] < low[i] || p[i] > high[i]), "{p}");
        }
    }

    #[test]
    fn a_ball_misses_no_point(
        points in prop::collection::vec(point(), 0..60),
        centre in point(),
        radius in 0.0..2.0,
    ) {
        let (cells, order) = Cells::new(&points, SIDE);
        let (low, high) = (centre.map(|c| c - radius), centre.map(|c| c + radius));
        let found = found(&points, &order, cells.around(&centre, radius), &low, &high)?;
        for (p, found) in points.iter().zip(found) {
            prop_assert!(found || (p - centre).norm() > radius - 1e-12, "{p}");
        }
    }
}

#[test]
fn a_far_outlier_makes_the_cells_larger() {
    let points = [[0.0; 3], [0.01; 3], [1e6; 3]].map(Point3::from);
    let (cells, order) = Cells::new(&points, 0.01);
    assert!(cells.side() > 1e3);
    assert!(cells.around(&points[0], 0.1).flat_map(|run| &order[run]).eq(&[0, 1]));
    assert!(cells.around(&points[2], 0.1).flat_map(|run| &order[run]).eq(&[2]));
}

#[test]
fn nothing_is_found_beside_the_grid_or_at_no_place() {
    let points = [[0.0; 3], [1.0; 3]].map(Point3::from);
    let (cells, _) = Cells::new(&points, SIDE);
    assert!(cells.around(&Point3::new(0.5, 0.5, 2.0), 0.5).next().is_none());
    assert!(cells.around(&Point3::new(0.5, f64::NAN, 0.5), 0.5).next().is_none());
    assert!(cells.around(&points[0], f64::NAN).next().is_none());
    assert!(cells.between(&points[1], &points[0]).next().is_none());
    let none = Cells::default();
    assert!(none.around(&Point3::origin(), 1.0).all(|run| run.is_empty()));
}
