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
    // Straight in time between knots: a change over a cycle is greatest where the cycle begins or
    // ends in a knot, just before it or just after.
    for (knot, ends) in windows(plan.times(), guard.period_ns as f64) {
        for &j in &limited {
            let [from, to] = ends.map(|(passed, time)| acceleration_in(plan, passed, time, j));
            guard.allows_step(j, from, to).map_err(|(shown, most)| {
                Rejection::new(Reason::Jerk).knot(knot).joint(j).value(shown, most)
            })?;
        }
    }
    Ok(())
}

/// All spans of time of that length that begin or end in a knot, just before it or just after: the
/// knot, and for both ends how many knots are behind them, and when they are. \[ns\]
fn windows(times: &[f64], length: f64) -> impl Iterator<Item = (usize, [(usize, f64); 2])> {
    times.iter().enumerate().flat_map(move |(knot, &time)| {
        [time - length, time].into_iter().flat_map(move |begin| {
            [false, true].map(|just_after| {
                (knot, [begin, begin + length].map(|at| (passed(times, at, just_after), at)))
            })
        })
    })
}

/// How many knots are behind a moment: those at that very moment too, where it is `just_after` them.
pub(crate) fn passed(times: &[f64], at: f64, just_after: bool) -> usize {
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
/// may change it in a cycle, and changes in no cycle by more, however close the knots are. At both
/// ends the arm holds, but for a plan that joins another one: that its first velocity is the one
/// there is judged when it does.
pub(super) fn check_corners(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    if plan.has_corners() || plan.interpolation() == Interpolation::Cubic {
        return Ok(());
    }
    let corner = |knot: usize, before: &JointVector, after: &JointVector| {
        guard.matches_velocity(before, after).map_err(|(joint, step)| {
            let bound = guard.velocity_tolerance(joint);
            Rejection::new(Reason::Corner).knot(knot).joint(joint).value(step, bound)
        })
    };
    // By how many knots are behind.
    let joins = matches!(plan.join(), Join::Knot { .. });
    let along: Vec<JointVector> = plan
        .knots
        .windows(2)
        .map(|k| sample(&k[0], &k[1], plan.interpolation(), k[1].time).v)
        .collect();
    let first = along.first().copied().filter(|_| joins).unwrap_or(JointVector::ZERO);
    let along: Vec<JointVector> =
        [first].into_iter().chain(along).chain([JointVector::ZERO]).collect();
    for (knot, pair) in along.windows(2).enumerate().skip(1) {
        corner(knot, &pair[0], &pair[1])?;
    }
    // How it begins is judged then.
    let cycle = guard.period_ns as f64 - ROUNDING_S * 1e9;
    for (knot, ends) in windows(plan.times(), cycle).filter(|&(knot, _)| knot > 0) {
        let [before, after] = ends.map(|(passed, _)| &along[passed]);
        corner(knot, before, after)?;
    }
    Ok(())
}
