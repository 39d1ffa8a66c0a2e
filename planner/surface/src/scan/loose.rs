//! Points that lie apart from the surface, in scans that no camera has made: nothing flies there, so
//! each is a thing.

use std::collections::HashSet;

use nalgebra::{Point3, UnitVector3, Vector3};
use rayon::prelude::*;

use super::cloud::Scan;
use super::measured::STANDS_FOR;
use super::place::PlacedScan;
use crate::grid::Grid;

/// Farthest that a surface is looked for that says which way a loose point looks. \[m\]
const NEAR: f64 = 1.0;

/// Side of the cells in which it is looked for. \[m\]
const SIDE: f64 = NEAR / 16.0;

/// Adds the points of views without a sensor that the surface does not stand for, one in each voxel,
/// as far as `belongs` lets them; where they are more than `most`, evenly chosen ones. Too few are
/// around them for a surface of their own: they look as their file says, else as the surface nearest
/// to them does.
pub(super) fn join(
    mut surface: Scan,
    scan: &PlacedScan,
    voxel: f64,
    most: usize,
    belongs: impl Fn(&Point3<f64>) -> bool + Sync,
) -> Scan {
    let apart = STANDS_FOR.max(2.0 * voxel);
    let grid = Grid::new(&surface.points, apart);
    let is_loose = |p: &Point3<f64>| belongs(p) && grid.nearest(p, apart, |_| true).is_none();
    let mut taken = HashSet::new();
    let mut found: Vec<(Point3<f64>, Option<UnitVector3<f64>>)> = Vec::new();
    for view in scan.views.iter().filter(|view| view.sensor.is_none()) {
        let loose: Vec<usize> =
            (0..view.points.len()).into_par_iter().filter(|&i| is_loose(&view.points[i])).collect();
        for i in loose {
            let point = view.points[i];
            if taken.insert([0, 1, 2].map(|axis| (point[axis] / voxel).floor() as i64)) {
                found.push((point, view.normals.as_ref().map(|normals| normals[i])));
            }
        }
    }
    if most == 0 || found.is_empty() {
        return surface;
    }
    let step = found.len().div_ceil(most);
    let wide = Grid::new(&surface.points, SIDE);
    let as_nearest = |p: &Point3<f64>| {
        wide.nearest(p, NEAR, |_| true).map(|(at, _)| surface.normals[at as usize])
    };
    let joined: Vec<(Point3<f64>, UnitVector3<f64>)> = found
        .par_iter()
        .step_by(step)
        .map(|(p, own)| (*p, own.or_else(|| as_nearest(p)).unwrap_or(Vector3::z_axis())))
        .collect();
    for (point, normal) in joined {
        surface.points.push(point);
        surface.raw.push(point);
        surface.normals.push(normal);
    }
    surface
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::View;

    #[test]
    fn a_loose_point_stays_where_no_camera_could_have_invented_it() {
        let plate: Vec<Point3<f64>> = (0..900)
            .map(|i| Point3::new(f64::from(i % 30) * 0.005, f64::from(i / 30) * 0.005, 0.5))
            .collect();
        let normals = vec![Vector3::z_axis(); plate.len()];
        let (points, raw) = (plate.clone(), plate.clone());
        let surface = Scan { points, normals, raw, spacing: 0.005 };
        let loose = Point3::new(0.07, 0.07, 0.56);
        let beside = loose + Vector3::x() * 1e-4;
        let points = plate.iter().copied().chain([loose, beside]).collect();
        let view = View { points, ..View::default() };
        let mut scan = PlacedScan { views: vec![view] };
        let all = |_: &Point3<f64>| true;
        let joined = join(surface.clone(), &scan, 0.004, 9, all);
        assert_eq!(joined.points[..900], surface.points);
        assert_eq!(joined.points[900..], [loose]);
        assert_eq!((joined.raw[900], joined.normals[900]), (loose, Vector3::z_axis()));
        // Where the surface has all the points that there may be, none is added.
        assert_eq!(join(surface.clone(), &scan, 0.004, 0, all), surface);
        assert_eq!(join(surface.clone(), &scan, 0.004, 9, |p| p.z < 0.55), surface);
        scan.views[0].sensor = Some(Point3::new(0.0, 0.0, 2.0));
        assert_eq!(join(surface.clone(), &scan, 0.004, 9, all), surface);
    }
}
