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
            let most = way.norm() * libm::sin(roller.slip_max) + BESIDE;
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

#[cfg(test)]
mod tests {
    use nullsweep_robot::{ArmSpec, JointVector, Robot, Roller, Side, Tool};

    use super::*;
    use crate::plan::PlanKnot;

    /// Violations of a roller whose contact frame is turned by `turn` \[rad\] about its normal from the
    /// way that a turn of the first joint moves it.
    fn rolled(turn: f64, symmetric: bool, slip_max: f64) -> Vec<Violation> {
        let robot = Robot::pr2();
        let arm = robot.arm(&ArmSpec::pr2(Side::Right)).expect("the PR2's arm");
        // The first joint turns about the vertical: what looks down is moved level.
        let q = arm.home();
        let tip = arm.tip_pose(&q);
        let down = tip.rotation.inverse_transform_vector(&-Vector3::z());
        let moved = |by: f64| {
            let mut q = q;
            q[0] += by;
            q
        };
        let way = arm.tip_pose(&moved(0.05)).translation.vector - tip.translation.vector;
        let way = tip.rotation.inverse_transform_vector(&way);
        let about = nalgebra::UnitQuaternion::from_scaled_axis(down * turn);
        let travel = about * (way - down * way.dot(&down));
        let footprint = Footprint::Roller(Roller { radius: 0.03, slip_max });
        let tool = Tool {
            centre: [0.0; 3],
            approach: down.into(),
            across: down.cross(&travel).into(),
            symmetric,
            footprint,
            ..Tool::default()
        };
        let knot = |time_ns: u64, q: JointVector| PlanKnot {
            time_ns,
            line: Some([0.0; 3]),
            ..PlanKnot::free(q)
        };
        let knots = vec![knot(0, q), knot(1_000_000_000, moved(0.1))];
        slip(&Plan::of(&robot, &arm, &tool, knots), &arm)
    }

    #[test]
    fn a_roller_that_is_moved_sideways_breaks_the_rule() {
        use std::f64::consts::{FRAC_PI_2, PI};
        // The tip swings by 0.1 rad, and its way with it.
        assert!(rolled(0.0, true, 0.1).is_empty());
        assert!(rolled(PI, true, 0.1).is_empty(), "backwards");
        for (turn, symmetric) in [(FRAC_PI_2, true), (0.4, true), (PI, false), (-FRAC_PI_2, false)]
        {
            let found = rolled(turn, symmetric, 0.1);
            assert_eq!(found.len(), 1, "{turn}");
            assert_eq!((found[0].knot, found[0].kind), (1, ViolationKind::Slip));
        }
        assert!(rolled(0.4, true, 0.6).is_empty());
    }
}
