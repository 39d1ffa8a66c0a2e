//! A cloud as registration needs it.

use nalgebra::{Matrix3, Point3, UnitVector3};
use rayon::prelude::*;

use crate::fit::{PlaneFit, weight};
use crate::grid::Grid;
use crate::scan::View;
use crate::thin::thinned;

/// Radius of the neighbourhood of which a normal is made, at least. \[m\]
const RADIUS: f64 = 0.024;

/// Standard deviation across the ray at 1 m, in proportion to the distance (Nguyen et al. 2012). \[m\]
const LATERAL: f64 = 0.0015;
/// Standard deviation along the ray at 1 m, in proportion to the squared distance (Khoshelham &
/// Elberink 2012). \[m\]
const AXIAL: f64 = 0.001_43;
/// So far such a camera sees; what sees farther measures by other means. \[m\]
const FARTHEST: f64 = 4.0;

/// A thinned cloud with normals, towards the sensor where that is known.
pub(super) struct Cloud {
    pub(super) points: Vec<Point3<f64>>,
    pub(super) normals: Vec<UnitVector3<f64>>,
    /// Covariance of each point, as a depth camera measures it; the same every way where the sensor
    /// is not known. \[m²\]
    pub(super) noise: Vec<Matrix3<f64>>,
    /// Whether all normals have a side.
    pub(super) sided: bool,
    pub(super) grid: Grid,
}

impl Cloud {
    /// The means of voxels. \[m\]
    pub(super) fn coarse(views: &[View], side: f64) -> Self {
        let means = |view: &View| {
            let thin = thinned(&view.points, side);
            (thin.clone(), thin)
        };
        Self::of(views, (2.5 * side).max(RADIUS), 2.0 * side, means)
    }

    /// Points of the views themselves, at most so many: the same wherever the views stand.
    pub(super) fn fine(views: &[View], most: usize) -> Self {
        let all: usize = views.iter().map(|view| view.points.len()).sum();
        let stride = all.div_ceil(most.max(1)).max(1);
        let some = |view: &View| {
            (view.points.iter().step_by(stride).copied().collect(), view.points.clone())
        };
        Self::of(views, RADIUS, 0.5 * RADIUS, some)
    }

    /// What is kept of each view, with the points in whose neighbourhood its normals are found, and the
    /// side of the grid's cells. \[m\]
    fn of(
        views: &[View],
        radius: f64,
        side: f64,
        kept: impl Fn(&View) -> (Vec<Point3<f64>>, Vec<Point3<f64>>),
    ) -> Self {
        let (mut points, mut normals, mut noises) = (Vec::new(), Vec::new(), Vec::new());
        for view in views {
            let (kept, around) = kept(view);
            let grid = Grid::new(&around, radius);
            let found: Vec<Option<UnitVector3<f64>>> =
                kept.par_iter().map(|p| normal(p, &grid, radius, view.sensor)).collect();
            for (point, normal) in kept.iter().zip(found).filter_map(|(p, n)| Some((p, n?))) {
                points.push(*point);
                normals.push(normal);
                noises.push(noise(point, view.sensor));
            }
        }
        let sided = views.iter().all(|view| view.sensor.is_some());
        Self { grid: Grid::new(&points, side), points, normals, noise: noises, sided }
    }
}

/// The normal at a point; none where its neighbours are no surface.
fn normal(
    point: &Point3<f64>,
    grid: &Grid,
    radius: f64,
    sensor: Option<Point3<f64>>,
) -> Option<UnitVector3<f64>> {
    let mut fit = PlaneFit::new(*point);
    let mut count = 0;
    grid.within(point, radius, |_, neighbour, squared| {
        count += 1;
        fit.add(neighbour, weight(squared / (radius * radius)));
    });
    let plane = fit.solve().filter(|_| count >= 6)?;
    let [across, shorter, longer] = plane.variances;
    if across > 0.2 * shorter || shorter < 0.05 * longer {
        return None;
    }
    Some(match sensor {
        Some(sensor) if (sensor - point).dot(&plane.normal) < 0.0 => -plane.normal,
        _ => plane.normal,
    })
}

/// The covariance of a measured point. \[m²\]
fn noise(point: &Point3<f64>, sensor: Option<Point3<f64>>) -> Matrix3<f64> {
    let square = Matrix3::identity() * LATERAL.powi(2);
    let Some(ray) = sensor.map(|sensor| point - sensor) else { return square };
    let distance = ray.norm().clamp(0.1, FARTHEST);
    let Some(ray) = UnitVector3::try_new(ray, 1e-9) else { return square };
    let (lateral, axial) = (LATERAL * distance, AXIAL * distance * distance);
    let stretch = axial.powi(2) - lateral.powi(2);
    Matrix3::identity() * lateral.powi(2) + ray.into_inner() * ray.transpose() * stretch
}
