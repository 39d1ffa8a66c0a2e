//! A cloud with one point a voxel.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

/// The means of the points in each voxel of a side \[m\].
pub(crate) fn thinned(points: &[Point3<f64>], side: f64) -> Vec<Point3<f64>> {
    // A tree map, as the order of a hash map is not that of the last run.
    let mut cells: BTreeMap<[i64; 3], (Vector3<f64>, f64)> = BTreeMap::new();
    for point in points {
        let key = [0, 1, 2].map(|axis| (point[axis] / side).floor() as i64);
        let cell = cells.entry(key).or_insert((Vector3::zeros(), 0.0));
        cell.0 += point.coords;
        cell.1 += 1.0;
    }
    cells.into_values().map(|(sum, count)| Point3::from(sum / count)).collect()
}
