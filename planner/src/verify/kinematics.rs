//! Times, limits and rest.

use nullsweep_ipc_types::Knot;
use nullsweep_robot::{Arm, JointVector};

use super::violation::{Violation, ViolationKind};
use crate::plan::{Curve, Plan, PlanKnot, Profile, TrajectoryCursor};

/// Time between two samples of a plan with limited acceleration. \[ns\]
const SAMPLE_NS: u64 = 1_000_000;
/// The same. \[s\]
const SAMPLE: f64 = SAMPLE_NS as f64 * 1e-9;
/// What an acceleration may exceed its limit by, as a share of it.
const ROUNDING: f64 = 1e-6;
/// What rounding makes of the jerk of samples. \[rad/s³\] or \[m/s³\]
const DIFFERENCES: f64 = 1e-3;

/// Times, finiteness, velocities and soft limits of every segment.
pub(super) fn kinematics(plan: &Plan, arm: &Arm) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut report = |knot, kind, detail| found.push(Violation { knot, kind, detail });
    if plan.knots.len() < 2 {
        report(0, ViolationKind::TimeOrder, format!("{} knots, no motion", plan.knots.len()));
    }
    for (k, knot) in plan.knots.iter().enumerate() {
        if knot.q.iter().chain(&knot.v).any(|v| !v.is_finite()) {
            report(k, ViolationKind::NotFinite, format!("q {:?}, v {:?}", *knot.q, *knot.v));
        }
        let before = k.checked_sub(1).map(|b| &plan.knots[b]);
        let rises = before.map_or(knot.time_ns == 0, |b| knot.time_ns > b.time_ns);
        if !rises || knot.time_ns > Knot::LATEST_NS {
            report(k, ViolationKind::TimeOrder, format!("time {} ns", knot.time_ns));
            continue;
        }
        let curve = before.map(|_| plan.curve(k));
        let curve = curve.unwrap_or_else(|| Curve::line(&knot.q, &knot.q, 1.0));
        for (j, name) in arm.joint_names().iter().enumerate() {
            let limits = &arm.limits()[j];
            let velocity = curve.top_speed(j);
            if velocity > limits.velocity * (1.0 + 1e-9) {
                let detail = format!("{name}: {velocity:.4} of {:.4}", limits.velocity);
                report(k, ViolationKind::Velocity, detail);
            }
            if plan.profile.is_curved() {
                let acceleration = curve.top_acceleration(j);
                if acceleration > limits.acceleration * (1.0 + ROUNDING) {
                    let detail = format!("{name}: {acceleration:.4} of {:.4}", limits.acceleration);
                    report(k, ViolationKind::Acceleration, detail);
                }
            }
            if let Some(most) = jerk_limit(plan, arm, j) {
                let jerk = curve.jerk(j).abs();
                if jerk > most * (1.0 + ROUNDING) + DIFFERENCES {
                    report(k, ViolationKind::Jerk, format!("{name}: jerk {jerk:.4} of {most:.4}"));
                }
            }
            let (low, high) = arm.braking_limits(j, velocity);
            // Joints that turn without end are bounded too: no executor takes them further.
            let (low, high) = (low.max(-Knot::FARTHEST), high.min(Knot::FARTHEST));
            let (lowest, highest) = curve.range(j);
            if !(lowest >= low && highest <= high) {
                let detail =
                    format!("{name}: {lowest:.4} … {highest:.4} outside {low:.4} … {high:.4}");
                report(k, ViolationKind::SoftLimit, detail);
            }
        }
    }
    if plan.profile.is_curved() {
        let starts = plan.knots.first().filter(|_| plan.continues.is_none()).map(|k| (0, k));
        let ends = plan.knots.last().map(|k| (plan.knots.len() - 1, k));
        for (k, knot) in starts.into_iter().chain(ends) {
            if knot.v != JointVector::default() {
                report(k, ViolationKind::Acceleration, format!("not at rest: {:?}", knot.v));
            }
        }
        // Samples ask for times that rise.
        if !found.iter().any(|v| v.kind == ViolationKind::TimeOrder) {
            found.extend(sampled(plan, arm));
            found.extend(jerks(plan, arm));
        }
    }
    found
}

/// Velocity and acceleration of the positions that a controller gets every [`SAMPLE`], by
/// differences: what bounds on each curve by itself do not see is a step where two curves meet.
/// Only samples around a knot are looked at, so that a long plan takes no longer.
fn sampled(plan: &Plan, arm: &Arm) -> Vec<Violation> {
    let mut found = Vec::new();
    let end_ns = plan.knots.last().map_or(0, |k| k.time_ns);
    let after = |knot: &PlanKnot| [1, 2].map(|more| knot.time_ns / SAMPLE_NS + more);
    let mut samples: Vec<u64> = plan.knots.iter().flat_map(after).collect();
    samples.retain(|&s| s >= 2 && s <= end_ns / SAMPLE_NS);
    samples.sort_unstable();
    samples.dedup();
    for sample in samples {
        let [two, one, now] = [2, 1, 0].map(|back| at(plan, (sample - back) * SAMPLE_NS));
        let ((_, two), (_, one), (knot, now)) = (two, one, now);
        for (j, name) in arm.joint_names().iter().enumerate() {
            let limits = &arm.limits()[j];
            let velocity = (now[j] - one[j]) / SAMPLE;
            let acceleration = (now[j] - 2.0 * one[j] + two[j]) / (SAMPLE * SAMPLE);
            let fast = velocity.abs() > limits.velocity * (1.0 + 1e-9);
            let hard = acceleration.abs() > limits.acceleration * (1.0 + ROUNDING);
            if fast || hard {
                let kind = if hard { ViolationKind::Acceleration } else { ViolationKind::Velocity };
                let time_ns = sample * SAMPLE_NS;
                let detail =
                    format!("{name} at {time_ns} ns: sampled {velocity:.4}, {acceleration:.4}");
                found.push(Violation { knot, kind, detail });
            }
        }
    }
    found
}

/// The knot in which the segment of a time ends, and where the joints are then. The times rise, and
/// the last is not earlier.
fn at(plan: &Plan, time_ns: u64) -> (usize, JointVector) {
    let knot = plan.knots.partition_point(|k| k.time_ns < time_ns).max(1);
    let curve = plan.curve(knot);
    let since = time_ns.saturating_sub(plan.knots[knot - 1].time_ns) as f64 * 1e-9;
    (knot, curve.at(since / curve.seconds()))
}

/// The jerk that a joint of a plan with limited jerk is to keep within: the plan's, and the URDF's.
fn jerk_limit(plan: &Plan, arm: &Arm, joint: usize) -> Option<f64> {
    let own = plan.jerk.map(|jerk| jerk[joint]);
    let given = arm.limits()[joint].jerk.filter(|_| plan.profile == Profile::Jerk);
    own.into_iter().chain(given).reduce(f64::min)
}

/// The jerk of the positions that a controller gets every [`SAMPLE`], by third differences, rest
/// before the start and after the end included.
fn jerks(plan: &Plan, arm: &Arm) -> Vec<Violation> {
    let limits: Vec<(usize, f64)> =
        (0..arm.dof()).filter_map(|j| Some((j, jerk_limit(plan, arm, j)?))).collect();
    let (Some(first), Some(last)) = (plan.knots.first(), plan.knots.last()) else {
        return Vec::new();
    };
    if limits.is_empty() {
        return Vec::new();
    }
    let mut found = Vec::new();
    let mut cursor = TrajectoryCursor::new(plan.trajectory());
    // A plan that goes on from another one has no rest before it.
    let before = if plan.continues.is_none() { 0 } else { 3 };
    let mut seen = [first.q; 4];
    for sample in 0..=last.time_ns / SAMPLE_NS + 4 {
        let (knot, q) = cursor.at((sample * SAMPLE_NS).min(last.time_ns));
        seen = [seen[1], seen[2], seen[3], q];
        if sample < before {
            continue;
        }
        for &(j, most) in &limits {
            let [a, b, c, d] = seen.map(|q| q[j]);
            let jerk = ((d - c) - 2.0 * (c - b) + (b - a)).abs() / SAMPLE.powi(3);
            if jerk > most * (1.0 + ROUNDING) + DIFFERENCES {
                let (name, time_ns) = (&arm.joint_names()[j], sample * SAMPLE_NS);
                let detail = format!("{name} at {time_ns} ns: sampled jerk {jerk:.4} of {most:.4}");
                found.push(Violation { knot, kind: ViolationKind::Jerk, detail });
            }
        }
    }
    found
}
