//! How a plan moves, against the executor's own limits.
//!
//! What is bounded: positions everywhere, with the braking margin at each segment's speed;
//! velocities everywhere; of curves the acceleration everywhere and, where the URDF gives a limit of
//! it, the jerk, within each segment and as the setpoints show it from one to the next: a step of the
//! acceleration is as much jerk as it takes a cycle to make. Without such a limit the acceleration
//! may step, by no more than its own limits leave room for. Straight segments have neither, but
//! corners: steps of the velocity, which are bang-bang where the plan asks for them, and else no
//! more than a cycle's worth.

use nullsweep_ipc_types::{Interpolation, Reason};

use super::plan::{Join, ValidPlan};
use super::rejection::Rejection;
use crate::JointVector;
use crate::guard::Guard;
use crate::interpolate::{
    acceleration, ends, reach, sample, top_acceleration, top_jerk, top_speed,
};

/// A planner rounds its times to whole nanoseconds, so a segment may be this much too short. \[s\]
const ROUNDING_S: f64 = 1e-9;
/// What a planner's acceleration or jerk may exceed its limit by, as a share of it.
const ROUNDING_SHARE: f64 = 1e-6;
/// Room for the rounding of positions. \[rad\]
const SLACK: f64 = 1e-9;

/// Soft limits with the braking margin at each segment's speed, velocity, acceleration and jerk.
pub(super) fn check_segments(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    let kind = plan.interpolation();
    for (i, pair) in plan.knots.windows(2).enumerate() {
        let (a, b) = (&pair[0], &pair[1]);
        let seconds = (b.time - a.time) * 1e-9;
        for (j, bound) in guard.used().iter().enumerate() {
            let speed = top_speed(a, b, kind, j);
            let fits = speed * seconds <= bound.velocity() * (seconds + ROUNDING_S) + SLACK;
            let (low, high) = reach(a, b, kind, j);
            let (lower, upper) = bound.limits_at(speed);
            let at = |reason| Rejection::new(reason).knot(i + 1).joint(j);
            // Written so that NaN breaks every rule.
            if !(low >= lower - SLACK) {
                return Err(at(Reason::SoftLimit).value(low, lower));
            }
            if !(high <= upper + SLACK) {
                return Err(at(Reason::SoftLimit).value(high, upper));
            }
            if !fits {
                return Err(at(Reason::Velocity).value(speed, bound.velocity()));
            }
            let most = bound.limits.acceleration;
            let hardest = top_acceleration(a, b, kind, j);
            if !(hardest <= most * (1.0 + ROUNDING_SHARE) + SLACK) {
                return Err(at(Reason::Acceleration).value(hardest, most));
            }
            if let Some(most) = bound.limits.jerk {
                let hardest = top_jerk(a, b, kind, j);
                if !(hardest <= most * (1.0 + ROUNDING_SHARE) + SLACK) {
                    return Err(at(Reason::Jerk).value(hardest, most));
                }
            }
        }
    }
    Ok(())
}

/// What setpoints a cycle apart show of a curve's jerk, whatever their phase: the acceleration
/// changes in no cycle by more than each joint's limit lets it. Before its first knot and after its
/// last one the arm holds; what a plan that joins another one at a knot begins with is judged there.
pub(super) fn check_jerk(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    let limited: Vec<usize> =
        (0..guard.used().len()).filter(|&j| guard.joints[j].limits.jerk.is_some()).collect();
    if limited.is_empty() || plan.interpolation() == Interpolation::Linear {
        return Ok(());
    }
    let (cycle, times) = (guard.period_ns as f64, plan.times());
    // Straight in time between knots: a change over a cycle is greatest where the cycle begins or
    // ends in a knot, just before it or just after.
    for (knot, &time) in times.iter().enumerate() {
        for begin in [time - cycle, time] {
            for just_after in [false, true] {
                let [from, to] = [begin, begin + cycle].map(|at| segment(times, at, just_after));
                for &j in &limited {
                    let from = acceleration_in(plan, from, begin, j);
                    let to = acceleration_in(plan, to, begin + cycle, j);
                    guard.allows_step(j, from, to).map_err(|(shown, most)| {
                        Rejection::new(Reason::Jerk).knot(knot).joint(j).value(shown, most)
                    })?;
                }
            }
        }
    }
    Ok(())
}

/// How many knots are behind a moment: those at that very moment too, where it is `just_after` them.
fn segment(times: &[f64], at: f64, just_after: bool) -> usize {
    times.partition_point(|&t| t < at || just_after && t == at)
}

/// A joint's acceleration after that many knots. \[rad/s²\]
fn acceleration_in(plan: &ValidPlan, passed: usize, time: f64, joint: usize) -> f64 {
    let (kind, knots) = (plan.interpolation(), plan.knots());
    match (passed.checked_sub(1).and_then(|k| knots.get(k)), knots.get(passed)) {
        (Some(a), Some(b)) => acceleration(a, b, kind, joint, time),
        (None, Some(_)) if matches!(plan.join(), Join::Knot { .. }) => {
            knots.get(1).map_or(0.0, |b| ends(&knots[0], b, kind, joint)[0])
        }
        _ => 0.0,
    }
}

/// A curve must come to rest: after its last knot the arm holds.
pub(super) fn check_end(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    let curved = plan.interpolation() == Interpolation::Cubic;
    let Some(last) = plan.knots.last().filter(|_| curved) else { return Ok(()) };
    guard.matches_velocity(&last.v, &JointVector::ZERO).map_err(|(joint, speed)| {
        Rejection::new(Reason::Velocity)
            .knot(plan.knots.len() - 1)
            .joint(joint)
            .value(speed, guard.velocity_tolerance(joint))
    })
}

/// Straight segments without leave for corners: the velocity steps nowhere by more than each joint
/// may change it in a cycle. At both ends the arm holds, but for a plan that joins another one:
/// that its first velocity is the one there is judged when it does.
pub(super) fn check_corners(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    if plan.has_corners() || plan.interpolation() == Interpolation::Cubic {
        return Ok(());
    }
    let along =
        plan.knots.windows(2).map(|k| sample(&k[0], &k[1], plan.interpolation(), k[1].time).v);
    let mut before = None;
    for (knot, after) in along.chain([JointVector::ZERO]).enumerate() {
        if let Some(before) = before.replace(after) {
            guard.matches_velocity(&before, &after).map_err(|(joint, step)| {
                let bound = guard.velocity_tolerance(joint);
                Rejection::new(Reason::Corner).knot(knot).joint(joint).value(step, bound)
            })?;
        }
    }
    Ok(())
}
