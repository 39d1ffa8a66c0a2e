//! Collisions of the standing body, and of the arm along every segment.

use nullsweep_collision::{Exact, ToolContact};
use nullsweep_robot::Arm;
use rayon::prelude::*;

use super::violation::{Violation, ViolationKind};
use crate::plan::{LIFT, Plan};

/// Joints move at most this far between two looks at collisions. \[rad\] or \[m\]
const COLLISION_STEP: f64 = 0.02;
/// What a lift may exceed [`LIFT`] by. \[m\]
const LIFT_SLACK: f64 = 0.002;

/// What does not move with the arm (base, torso, the other arm) against the scene, as a violation of
/// the first knot.
pub(super) fn standing(exact: &Exact) -> Option<Violation> {
    let kind = ViolationKind::Collision;
    exact.stance_hit().map(|hit| Violation { knot: 0, kind, detail: hit.to_string() })
}

/// Exact collision checks along every segment.
pub(super) fn collisions(
    plan: &Plan,
    arm: &Arm,
    exact: &Exact,
    tick: &(dyn Fn() + Sync),
) -> (Vec<Violation>, usize) {
    let lifts = lifts(plan, arm);
    let per_segment: Vec<(Option<Violation>, usize)> = (0..plan.knots.len())
        .into_par_iter()
        .map(|k| {
            let curve = plan.curve(k);
            let steps = curve.steps(COLLISION_STEP);
            // A plan may begin on the surface, where another one left the arm.
            let may_touch = k == 0 || plan.on_surface(k) || lifts[k];
            let contact = if may_touch { ToolContact::Allowed } else { ToolContact::Forbidden };
            let hit = (1..=steps).find_map(|s| {
                let q = curve.at(s as f64 / steps as f64);
                exact.first_hit(&q, contact).map(|hit| Violation {
                    knot: k,
                    kind: ViolationKind::Collision,
                    detail: hit.to_string(),
                })
            });
            tick();
            (hit, steps)
        })
        .collect();
    let checks = per_segment.iter().map(|(_, n)| n).sum();
    (per_segment.into_iter().filter_map(|(hit, _)| hit).collect(), checks)
}

/// Which segments of transfers, by the knot that ends them, lift the pad off the surface or set it
/// down: those next to a knot on the surface, or at the plan's start, until the pad's centre is
/// [`LIFT`] away, with some slack. There it may still touch.
fn lifts(plan: &Plan, arm: &Arm) -> Vec<bool> {
    let tool = plan.tool.on(arm);
    let centre = |k: usize| tool.centre(&plan.knots[k].q);
    let mut lifts = vec![false; plan.knots.len()];
    let starts_in_contact = |k: usize| plan.knots[k].line.is_some() || k == 0;
    for k in 0..plan.knots.len() {
        if starts_in_contact(k) {
            let near = |other: usize| (centre(other) - centre(k)).norm() <= LIFT + LIFT_SLACK;
            let up = (k + 1..plan.knots.len()).take_while(|&n| !plan.on_surface(n) && near(n));
            up.for_each(|n| lifts[n] = true);
            let down = (1..=k).rev().take_while(|&n| !plan.on_surface(n) && near(n - 1));
            down.for_each(|n| lifts[n] = true);
        }
    }
    lifts
}
