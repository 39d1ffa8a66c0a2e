//! How much of the surface the pad can cover at all.

use std::collections::HashSet;
use std::f64::consts::TAU;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use nalgebra::{Isometry3, UnitVector3};
use nullsweep_surface::{Patch, Scan, SurfacePoint};
use rayon::prelude::*;

use crate::progress::Progress;
use crate::sweep::visit_swept;
use crate::workcell::{Bed, Workcell, contact_pose, direction, middle_out, redundancies};

/// Side of the cubes in each of which the pad is tried on one point of the surface. \[m\]
const SPACING: f64 = 0.015;
/// Headings at each place, of a symmetric pad over half a turn.
const HEADINGS: usize = 8;
/// Directions in which the pad is tilted, and how far. \[rad\]
const ASIDE: usize = 8;
const TILT: f64 = 0.2;
/// Redundancy values at least.
const LEAST_VALUES: usize = 24;

/// For each point of the surface whether some posture of the arm puts the pad on it, within its limits
/// and free of collision: of the pad on a grid of places on the surface, upright and tilted, at several
/// headings. Points that are `known` to be swept are not looked at again and count. Whether the arm can
/// come there is not asked. All in the root frame.
#[must_use]
pub fn coverable(
    cell: Workcell<'_>,
    scan: &Scan,
    bed: &Bed,
    (known, ik_samples): (&[bool], usize),
    progress: &dyn Progress,
) -> Vec<bool> {
    let values = redundancies(cell.arm.ik().redundancy_range(), ik_samples.max(LEAST_VALUES));
    let values = middle_out(values);
    let covered: Vec<AtomicBool> = known.iter().map(|known| AtomicBool::new(*known)).collect();
    let mut cubes = HashSet::new();
    let cube = |i: usize| [0, 1, 2].map(|axis| (scan.points[i][axis] / SPACING).floor() as i64);
    let feet: Vec<SurfacePoint> = (0..scan.points.len())
        .filter(|&i| cubes.insert(cube(i)))
        .map(|i| SurfacePoint { point: scan.points[i], normal: scan.normals[i] })
        .filter_map(|foot| bed.surface().project(&foot.point, &foot.normal))
        .collect();
    progress.stage("what the pad can cover", Some(feet.len()));
    feet.par_iter().for_each(|foot| {
        let poses = poses(cell, bed, foot);
        let contacts: Vec<Isometry3<f64>> = poses.iter().map(|(pose, _)| *pose).collect();
        let mut under = vec![Vec::new(); poses.len()];
        visit_swept(scan, &contacts, cell.tool, |pose, point| under[pose].push(point));
        // Whichever thread comes first: what is covered in the end is the same.
        for ((pose, heading), under) in poses.iter().zip(under) {
            let is_new = under.iter().any(|&point| !covered[point].load(Relaxed));
            if is_new && cell.first_sample(pose, *heading, &values).is_some() {
                under.iter().for_each(|&point| covered[point].store(true, Relaxed));
            }
        }
        progress.tick();
    });
    covered.into_iter().map(AtomicBool::into_inner).collect()
}

/// The pad on a place of the surface, upright first.
fn poses(cell: Workcell<'_>, bed: &Bed, foot: &SurfacePoint) -> Vec<(Isometry3<f64>, f64)> {
    let SurfacePoint { point: centre, normal } = *foot;
    let tilted = (0..ASIDE).map(|k| {
        let aside = direction(&normal, TAU * k as f64 / ASIDE as f64) * libm::sin(TILT);
        UnitVector3::new_normalize(normal.scale(libm::cos(TILT)) + aside)
    });
    let laid = std::iter::once(normal)
        .chain(tilted)
        .filter_map(|normal| bed.laid(Patch { centre, normal, points: Vec::new(), rmse: 0.0 }));
    let turn = cell.tool.heading_range();
    laid.flat_map(|place| {
        (0..HEADINGS).map(move |h| {
            let heading = turn * h as f64 / HEADINGS as f64;
            let travel = direction(&place.normal, heading);
            let pose = contact_pose(&place.centre, &place.normal, &travel, cell.tool.stand_off);
            (pose, heading)
        })
    })
    .collect()
}
