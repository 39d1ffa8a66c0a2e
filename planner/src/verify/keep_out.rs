//! Whether the pad ever touches what it is to keep out of, by its footprint alone: nothing here asks a
//! collision check.

use nalgebra::Point3;
use nullsweep_robot::{Arm, Tool};
use nullsweep_surface::Grid;
use rayon::prelude::*;

use super::violation::{Violation, ViolationKind};
use crate::plan::Plan;

/// Joints move at most this far between two looks at the pad. \[rad\] or \[m\]
const STEP: f64 = 0.01;

/// The first point of each segment that the pad touches: on the surface, and, of a pad that works by
/// touching, everywhere.
pub(super) fn keep_out(plan: &Plan, arm: &Arm, points: &[Point3<f64>]) -> Vec<Violation> {
    if points.is_empty() {
        return Vec::new();
    }
    let tool = &plan.tool;
    let z = worked(tool);
    let reach = if tool.touches() {
        libm::hypot(tool.outer_radius(), z[0].abs().max(z[1].abs()))
    } else {
        tool.farthest()
    };
    let grid = Grid::new(points, 0.5 * reach);
    let pad = tool.on(arm);
    let touched = |k: usize| {
        let curve = plan.curve(k);
        let steps = curve.steps(STEP).max(1);
        (0..=steps).find_map(|step| {
            let pose = pad.pose(&curve.at(step as f64 / steps as f64));
            let mut first = None;
            grid.within(&pose.translation.vector.into(), reach, |_, point, _| {
                let own = pose.inverse_transform_point(point);
                let inside = if tool.touches() {
                    tool.is_under(own.x, own.y) && (z[0]..=z[1]).contains(&own.z)
                } else {
                    tool.works_on(own.x, own.y, own.z - tool.stand_off)
                };
                if first.is_none() && inside {
                    first = Some(*point);
                }
            });
            first
        })
    };
    let looked = |k: &usize| tool.stand_off <= 0.0 || plan.on_surface(*k);
    let found = (1..plan.knots.len()).into_par_iter().filter(looked).filter_map(|k| {
        touched(k).map(|p| Violation {
            knot: k,
            kind: ViolationKind::KeepOut,
            detail: format!(
                "{} comes over ({:.3}, {:.3}, {:.3}), which it is to keep out of",
                tool.name, p.x, p.y, p.z
            ),
        })
    });
    found.collect()
}

/// From where to where along its axis the pad works: its body where that touches, and as far before its
/// plane as it sweeps. \[m\]
fn worked(tool: &Tool) -> [f64; 2] {
    let back = tool.stand_off - tool.reach_normal;
    let body = if tool.stand_off <= 0.0 { -tool.thickness } else { f64::INFINITY };
    [back.min(body), tool.hover()]
}
