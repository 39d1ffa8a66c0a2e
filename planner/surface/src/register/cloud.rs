//! A cloud as registration needs it.

use nalgebra::{Point3, UnitVector3};
use rayon::prelude::*;

use crate::fit::{PlaneFit, weight};
use crate::grid::Grid;
use crate::scan::View;
use crate::thin::thinned;

/// How a cloud is thinned.
#[derive(Clone, Copy)]
pub(super) enum Thin {
    /// To the means of voxels. \[m\]
    Voxel(f64),
    /// To points of the view itself, at most so many in what moves: the same wherever it stands.
    Points(usize),
}

/// Radius of the neighbourhood of which a normal is made, at least. \[m\]
const RADIUS: f64 = 0.024;

/// A thinned cloud with normals, towards the sensor where that is known.
pub(super) struct Cloud {
    pub(super) points: Vec<Point3<f64>>,
    pub(super) normals: Vec<UnitVector3<f64>>,
    /// Whether all normals have a side.
    pub(super) sided: bool,
    pub(super) grid: Grid,
}

impl Cloud {
    pub(super) fn of(views: &[View], thin: Thin) -> Self {
        let all: usize = views.iter().map(|view| view.points.len()).sum();
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for view in views {
            let (kept, around, radius) = match thin {
                Thin::Voxel(side) => {
                    let thin = thinned(&view.points, side);
                    (thin.clone(), thin, (2.5 * side).max(RADIUS))
                }
                Thin::Points(most) => {
                    let stride = all.div_ceil(most.max(1)).max(1);
                    let kept = view.points.iter().step_by(stride).copied().collect();
                    (kept, view.points.clone(), RADIUS)
                }
            };
            let grid = Grid::new(&around, radius);
            let found: Vec<Option<UnitVector3<f64>>> =
                kept.par_iter().map(|p| normal(p, &grid, radius, view.sensor)).collect();
            for (point, normal) in kept.iter().zip(found).filter_map(|(p, n)| Some((p, n?))) {
                points.push(*point);
                normals.push(normal);
            }
        }
        let side = match thin {
            Thin::Voxel(side) => 2.0 * side,
            Thin::Points(_) => 0.5 * RADIUS,
        };
        let sided = views.iter().all(|view| view.sensor.is_some());
        Self { grid: Grid::new(&points, side), points, normals, sided }
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
