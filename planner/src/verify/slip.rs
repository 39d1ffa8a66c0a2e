//! Whether a roller is ever moved sideways.

use nalgebra::{Isometry3, Vector3};
use nullsweep_robot::{Arm, Footprint};

use super::violation::{Violation, ViolationKind};
use crate::plan::Plan;

/// Joints move at most this far between two looks. \[rad\] or \[m\]
const STEP: f64 = 0.01;
/// Lengths of way over which the direction is looked at. \[m\]
const WAY: f64 = 0.005;
/// What the way may be beside the roller's own by what the line's tolerance leaves. \[m\]
const BESIDE: f64 = 0.0003;

/// The segments in which a roller goes farther sideways than its `slip_max` allows; none of another
/// tool.
pub(super) fn slip(plan: &Plan, arm: &Arm) -> Vec<Violation> {
    let tool = &plan.tool;
    let Footprint::Roller(roller) = tool.footprint else { return Vec::new() };
    let pad = tool.on(arm);
    let mut found: Vec<Violation> = Vec::new();
    // Where the length of way that is looked at begins.
    let mut from: Option<Isometry3<f64>> = None;
    for k in 1..plan.knots.len() {
        if !plan.on_surface(k) {
            from = None;
            continue;
        }
        let curve = plan.curve(k);
        let steps = curve.steps(STEP).max(1);
        for step in 0..=steps {
            let pose = pad.pose(&curve.at(step as f64 / steps as f64));
            let start = from.get_or_insert(pose);
            let way = pose.translation.vector - start.translation.vector;
            if way.norm() < WAY {
                continue;
            }
            let middle = start.lerp_slerp(&pose, 0.5).rotation;
            let [ahead, sideways] =
                [Vector3::x(), Vector3::y()].map(|axis| (middle * axis).dot(&way));
            *start = pose;
            let most = way.norm() * roller.slip_max.sin() + BESIDE;
            let is_rolled = sideways.abs() <= most && (tool.symmetric || ahead >= -BESIDE);
            if !is_rolled && found.last().is_none_or(|last| last.knot != k) {
                found.push(Violation {
                    knot: k,
                    kind: ViolationKind::Slip,
                    detail: format!(
                        "{} goes {:.1} mm sideways and {:.1} mm ahead: a roller rolls within {} rad of \
                         its own direction",
                        tool.name,
                        1e3 * sideways.abs(),
                        1e3 * ahead,
                        roller.slip_max
                    ),
                });
            }
        }
    }
    found
}
