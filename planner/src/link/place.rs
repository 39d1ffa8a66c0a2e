//! Where on a plan an arm is.

use std::fmt;

use nullsweep_ipc_types::{JointArray, Telemetry};
use nullsweep_robot::MAX_DOF;

use crate::plan::Plan;

/// How far the arm may be commanded from the plan that it is said to run: cubic segments leave the
/// straight line between two knots by less. \[rad\] or \[m\]
const ON_PLAN: f64 = 0.05;
/// How far on in its plan a stopped arm may be than it was told to be: a fault brakes on the path after
/// its plan has ended.
pub(super) const BRAKING_NS: u64 = 2_000_000_000;

/// A joint that is not where a plan has it in the segment behind a knot. \[rad\] or \[m\]
#[derive(Clone, Debug, PartialEq)]
pub struct Off {
    /// Its name.
    pub joint: String,
    /// Where it is commanded.
    pub commanded: f64,
    /// The knot.
    pub knot: usize,
    /// Least position of the joint there.
    pub low: f64,
    /// Greatest position of the joint there.
    pub high: f64,
}

impl fmt::Display for Off {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { joint, commanded, knot, low, high } = self;
        let next = knot + 1;
        write!(
            f,
            "{joint} is commanded to {commanded:.4}, knots {knot} and {next} have it in {low:.4} … {high:.4}"
        )
    }
}

/// Where on a plan an arm is that was left on its way: the last knot that it has passed. `from`: the knot in
/// which it was left, where somebody knows; it may have braked on the path since. Else the place must tell:
/// it does where the plan comes by only once. `None` where the arm is not on the plan, or it is not told
/// where.
#[must_use]
pub fn left_at(plan: &Plan, now: &Telemetry, from: Option<usize>) -> Option<usize> {
    let last = plan.knots.len().checked_sub(1)?;
    let is_there = |k: &usize| runs(plan, &now.commanded, *k).is_ok();
    if let Some(from) = from {
        let from = from.min(last.saturating_sub(1));
        let end = plan.knots[from].time_ns.saturating_add(BRAKING_NS);
        let braked = plan.knots.partition_point(|k| k.time_ns <= end).min(last);
        return (from..braked.max(from + 1)).find(is_there);
    }
    let there: Vec<usize> = (0..last).filter(is_there).collect();
    let (first, end) = (*there.first()?, *there.last()?);
    let once = end - first + 1 == there.len()
        && plan.knots[end].time_ns <= plan.knots[first].time_ns + BRAKING_NS;
    once.then_some(first)
}

/// Whether the arm is commanded to where this plan has it in this knot's segment.
pub(super) fn runs(plan: &Plan, at: &JointArray, knot: usize) -> Result<(), Off> {
    let knot = knot.min(plan.knots.len().saturating_sub(2));
    let Some([a, b]) = plan.knots.get(knot..knot + 2) else { return Ok(()) };
    for (j, name) in plan.joints.iter().enumerate().take(MAX_DOF) {
        let (low, high) = (a.q[j].min(b.q[j]), a.q[j].max(b.q[j]));
        // Whole turns of a continuous joint make no difference.
        let turns = (at[j] - 0.5 * (low + high)) / std::f64::consts::TAU;
        let commanded = at[j] - turns.round() * std::f64::consts::TAU;
        if !(low - ON_PLAN..=high + ON_PLAN).contains(&commanded) {
            let joint = name.clone();
            return Err(Off { joint, commanded, knot, low, high });
        }
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests {
    use nullsweep_ipc_types::MAX_JOINTS;
    use nullsweep_robot::{JointVector, Tool};

    use super::*;
    use crate::plan::{CostKind, FORMAT, Method, PlanKnot, Profile};

    /// One joint that turns by 0.1 rad a second.
    pub(in crate::link) fn plan() -> Plan {
        let knot = |k: u64| {
            let mut q = [0.0; MAX_DOF];
            q[0] = 0.1 * k as f64;
            PlanKnot {
                time_ns: k * 1_000_000_000,
                q: JointVector::new(q),
                v: JointVector::ZERO,
                line: None,
                patch: None,
            }
        };
        Plan {
            format: FORMAT,
            robot: "one".into(),
            fingerprint: 1,
            joints: vec!["roll".into()],
            held: Vec::new(),
            tool: Tool::default(),
            base: [0.0; 3],
            base_height: 0.0,
            method: Method::Tsp,
            cost: CostKind::Time,
            profile: Profile::Velocity,
            jerk: None,
            seed: 1,
            knots: (0..10).map(knot).collect(),
            patches: Vec::new(),
            surface: Vec::new(),
            regions: Vec::new(),
            continues: None,
            past: Vec::new(),
            left: Vec::new(),
            seal: None,
        }
    }

    #[test]
    fn another_plan_is_told_apart() {
        let plan = plan();
        let mut at = [0.0; MAX_JOINTS];
        at[0] = 0.35;
        runs(&plan, &at, 3).expect("on the plan");
        at[0] += 3.0 * std::f64::consts::TAU;
        runs(&plan, &at, 3).expect("as far, whole turns on");
        let error = runs(&plan, &at, 7).expect_err("elsewhere");
        assert_eq!(error.knot, 7, "{error}");
    }

    #[test]
    fn an_arm_that_was_left_is_found_where_that_is_told() {
        let there_and_back = {
            let mut plan = plan();
            let back: Vec<_> = plan.knots.iter().rev().skip(1).cloned().collect();
            plan.knots.extend(back);
            plan.knots.iter_mut().zip(0u64..).for_each(|(k, t)| k.time_ns = t * 1_000_000_000);
            plan
        };
        let at = |q: f64| {
            let mut now = <Telemetry as bytemuck::Zeroable>::zeroed();
            now.commanded[0] = q;
            now
        };
        let (once, twice) = (plan(), there_and_back);
        assert_eq!(left_at(&once, &at(0.36), None), Some(3));
        assert_eq!(left_at(&once, &at(0.36), Some(3)), Some(3));
        assert_eq!(left_at(&once, &at(1.35), None), None, "elsewhere");
        assert_eq!(left_at(&twice, &at(0.36), None), None, "on the way there, or back");
        assert_eq!(left_at(&twice, &at(0.36), Some(2)), Some(3));
        assert_eq!(left_at(&twice, &at(0.36), Some(14)), Some(14));
        assert_eq!(left_at(&twice, &at(0.36), Some(7)), None, "too far to have braked");
    }
}
