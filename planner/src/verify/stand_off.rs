//! Whether a tool that works from afar keeps its distance and faces the surface.

use nalgebra::{Isometry3, Point3, Vector3};
use nullsweep_robot::{Arm, Tool};
use nullsweep_surface::{Grid, Scan};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::violation::{Violation, ViolationKind};
use crate::plan::Plan;

/// Joints move at most this far between two looks. \[rad\] or \[m\]
const STEP: f64 = 0.01;
/// Farthest from the place that the tool is led over that the surface is looked for. \[m\]
const NEAR: f64 = 0.04;

/// How a tool that works from afar stands before the surface, over the motion along it: by the scan's
/// point nearest to the place `stand_off` ahead of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StandOff {
    /// The least distance along the tool's axis. \[m\]
    pub distance_min_m: f64,
    /// The greatest. \[m\]
    pub distance_max_m: f64,
    /// The greatest angle between the axis and the normal there, of the points as near as that one but
    /// for the scan's spacing the least. \[rad\]
    pub incidence_max_rad: f64,
}

/// One look.
#[derive(Clone, Copy)]
struct Look {
    distance: f64,
    incidence: f64,
}

/// The figures, and the first place of each segment where a bound is broken; nothing of a tool that
/// touches.
pub(super) fn stand_off(plan: &Plan, arm: &Arm, scan: &Scan) -> (Option<StandOff>, Vec<Violation>) {
    let tool = &plan.tool;
    if tool.touches() || scan.points.is_empty() {
        return (None, Vec::new());
    }
    let grid = Grid::new(&scan.points, NEAR);
    let pad = tool.on(arm);
    let of_segment = |k: usize| -> Vec<Look> {
        let curve = plan.curve(k);
        let steps = curve.steps(STEP).max(1);
        let at = |step: usize| pad.pose(&curve.at(step as f64 / steps as f64));
        (0..=steps).filter_map(|step| look(&at(step), tool, scan, &grid)).collect()
    };
    let segments: Vec<usize> = (1..plan.knots.len()).filter(|&k| plan.on_surface(k)).collect();
    let looks: Vec<(usize, Vec<Look>)> =
        segments.into_par_iter().map(|k| (k, of_segment(k))).collect();
    let broken = |(k, looks): &(usize, Vec<Look>)| {
        let detail = looks.iter().find_map(|look| broken(look, tool))?;
        Some(Violation { knot: *k, kind: ViolationKind::StandOff, detail })
    };
    let violations = looks.iter().filter_map(broken).collect();
    let all = || looks.iter().flat_map(|(_, looks)| looks);
    let figures = StandOff {
        distance_min_m: all().map(|look| look.distance).fold(f64::INFINITY, f64::min),
        distance_max_m: all().map(|look| look.distance).fold(0.0, f64::max),
        incidence_max_rad: all().map(|look| look.incidence).fold(0.0, f64::max),
    };
    (all().next().map(|_| figures), violations)
}

/// What is before the tool; `None` where no surface is.
fn look(pose: &Isometry3<f64>, tool: &Tool, scan: &Scan, grid: &Grid) -> Option<Look> {
    let target = pose * Point3::new(0.0, 0.0, tool.stand_off);
    let axis = pose.rotation * Vector3::z();
    let (nearest, squared) = grid.nearest(&target, NEAR, |_| true)?;
    let distance = (scan.points[nearest as usize].coords - pose.translation.vector).dot(&axis);
    let mut facing = -1.0_f64;
    grid.within(&target, squared.sqrt() + scan.spacing, |index, _, _| {
        facing = facing.max(-scan.normals[index as usize].dot(&axis));
    });
    Some(Look { distance, incidence: facing.clamp(-1.0, 1.0).acos() })
}

/// Which bound a look breaks; numbers that are none break it.
fn broken(look: &Look, tool: &Tool) -> Option<String> {
    let [near, far] = tool.distance();
    let Look { distance, incidence } = *look;
    if !(near..=far).contains(&distance) {
        return Some(format!(
            "{} is {distance:.3} m from the surface along its axis: {near} to {far} m are its own",
            tool.name
        ));
    }
    let is_within = incidence <= tool.reach_angle;
    (!is_within).then(|| {
        format!(
            "{} meets the surface at {incidence:.2} rad from its normal, at most {} is its reach_angle",
            tool.name, tool.reach_angle
        )
    })
}
