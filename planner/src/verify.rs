//! The finished plan, checked again by code that shares nothing with the search: a plan that
//! fails is never published.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::{Arm, JointVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::collision::{ToolContact, World};
use crate::coverage;
use crate::curve::Curve;
use crate::plan::Plan;
use crate::scan::Scan;
use crate::surface::Surface;
use crate::timing::Profile;

/// What was found wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violation {
    /// The knot in which the offending segment ends.
    pub knot: usize,
    /// What is wrong.
    pub kind: ViolationKind,
    /// Which joint or which bodies, and by how much.
    pub detail: String,
}

/// The kinds of [`Violation`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViolationKind {
    /// Knot times do not start at 0 or do not rise.
    TimeOrder,
    /// A value is not finite.
    NotFinite,
    /// A joint is faster than its limit.
    Velocity,
    /// A joint of a plan with limited acceleration speeds up or slows down by more than its limit,
    /// or is not at rest at the end.
    Acceleration,
    /// A joint is outside its soft limits with their braking margin at its velocity.
    SoftLimit,
    /// The arm, its tool or the body collides.
    Collision,
}

/// The figures of a verified plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verification {
    /// Everything found wrong, in the order of the knots.
    pub violations: Vec<Violation>,
    /// Joint vectors at which collisions were looked for.
    pub collision_checks: usize,
    /// Farthest that the pad centre leaves the planned line between knots. \[m\]
    pub line_deviation_max_m: f64,
    /// 95th percentile of the pad centre's distance from the scanned surface, less the
    /// stand-off, over the motion on the surface. \[m\]
    pub scan_distance_p95_m: f64,
    /// The largest of those. \[m\]
    pub scan_distance_max_m: f64,
    /// Share of all scanned points that are swept.
    pub coverage_all: f64,
    /// Share of the points of reachable patches that are swept.
    pub coverage_reachable: f64,
    /// For each scanned point whether it is swept.
    #[serde(skip)]
    pub swept: Vec<bool>,
}

/// Joints move at most this far between two looks at collisions. \[rad\] or \[m\]
const COLLISION_STEP: f64 = 0.02;
/// How far the pad is lifted off the surface before it must keep its margin, with some slack. \[m\]
const LIFT: f64 = 0.052;
/// Joints move at most this far between two looks at the pad. \[rad\] or \[m\]
const PAD_STEP: f64 = 0.01;
/// Time between two samples of a plan with limited acceleration. \[s\]
const SAMPLE: f64 = 1e-3;
/// What an acceleration may exceed its limit by, as a share of it.
const ROUNDING: f64 = 1e-6;

/// Checks limits, times and collisions, and measures line, distance and swept coverage. `arm`
/// and `scan` in the plan's stance: the root frame; `already` marks points that were swept before
/// the plan begins. `tick` is called once a segment.
#[must_use]
pub fn verify(
    plan: &Plan,
    arm: &Arm,
    world: &World,
    scan: &Scan,
    surface: &Surface,
    already: &[bool],
    tick: &(dyn Fn() + Sync),
) -> Verification {
    let mut violations = kinematics(plan, arm);
    let finite = !violations.iter().any(|v| v.kind == ViolationKind::NotFinite);
    if !finite {
        return Verification { violations, ..Verification::default() };
    }
    let (collisions, collision_checks) = collisions(plan, arm, world, tick);
    violations.extend(collisions);
    violations.sort_by_key(|v| v.knot);

    let pads = pad_motion(plan, arm);
    let line_deviation_max_m = pads.iter().map(|p| p.deviation).fold(0.0, f64::max);
    let mut distances: Vec<f64> = pads
        .par_iter()
        .map(|p| {
            let centre = Point3::from(p.pose.translation.vector);
            (surface.distance(&centre) - plan.tool.stand_off).abs()
        })
        .collect();
    distances.sort_by(f64::total_cmp);
    let poses: Vec<Isometry3<f64>> = pads.iter().map(|p| p.pose).collect();
    let mut swept = coverage::swept(scan, &poses, &plan.tool);
    for (now, before) in swept.iter_mut().zip(already) {
        *now |= before;
    }
    let share = |of: &dyn Fn(usize) -> bool| {
        let total = (0..swept.len()).filter(|&i| of(i)).count();
        let hit = (0..swept.len()).filter(|&i| of(i) && swept[i]).count();
        if total == 0 { 0.0 } else { hit as f64 / total as f64 }
    };
    Verification {
        violations,
        collision_checks,
        line_deviation_max_m,
        scan_distance_p95_m: percentile(&distances, 0.95),
        scan_distance_max_m: distances.last().copied().unwrap_or(0.0),
        coverage_all: share(&|_| true),
        coverage_reachable: share(&|i| plan.surface[i].reachable),
        swept,
    }
}

/// Times, finiteness, velocities and soft limits of every segment.
fn kinematics(plan: &Plan, arm: &Arm) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut report = |knot, kind, detail| found.push(Violation { knot, kind, detail });
    for (k, knot) in plan.knots.iter().enumerate() {
        if knot.q.iter().chain(&knot.v).any(|v| !v.is_finite()) {
            report(k, ViolationKind::NotFinite, format!("{:?}", knot.q));
        }
        let before = k.checked_sub(1).map(|b| &plan.knots[b]);
        let rises = before.map_or(knot.time_ns == 0, |b| knot.time_ns > b.time_ns);
        if !rises {
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
            if plan.profile == Profile::Acceleration {
                let acceleration = curve.top_acceleration(j);
                if acceleration > limits.acceleration * (1.0 + ROUNDING) {
                    let detail = format!("{name}: {acceleration:.4} of {:.4}", limits.acceleration);
                    report(k, ViolationKind::Acceleration, detail);
                }
            }
            let (low, high) = arm.braking_limits(j, velocity);
            let (lowest, highest) = curve.range(j);
            if !(lowest >= low && highest <= high) {
                let detail =
                    format!("{name}: {lowest:.4} … {highest:.4} outside {low:.4} … {high:.4}");
                report(k, ViolationKind::SoftLimit, detail);
            }
        }
    }
    if plan.profile == Profile::Acceleration {
        let starts = plan.knots.first().filter(|_| plan.continues.is_none()).map(|k| (0, k));
        let ends = plan.knots.last().map(|k| (plan.knots.len() - 1, k));
        for (k, knot) in starts.into_iter().chain(ends) {
            if knot.v != JointVector::default() {
                report(k, ViolationKind::Acceleration, format!("not at rest: {:?}", knot.v));
            }
        }
        found.extend(sampled(plan, arm));
    }
    found
}

/// Velocity and acceleration of the positions that a controller gets every [`SAMPLE`], by
/// differences: what bounds on each curve by itself do not see is a step where two curves meet.
fn sampled(plan: &Plan, arm: &Arm) -> Vec<Violation> {
    let mut found = Vec::new();
    let mut last: Vec<JointVector> = Vec::new();
    let mut k = 1;
    let end_ns = plan.knots.last().map_or(0, |k| k.time_ns);
    for time_ns in (0..=end_ns).step_by((SAMPLE * 1e9) as usize) {
        while k + 1 < plan.knots.len() && plan.knots[k].time_ns < time_ns {
            k += 1;
        }
        let Some(from) = plan.knots.get(k - 1).filter(|_| k < plan.knots.len()) else { break };
        let curve = plan.curve(k);
        let now = curve.at((time_ns - from.time_ns) as f64 * 1e-9 / curve.seconds());
        if let [.., two, one] = last[..] {
            for (j, name) in arm.joint_names().iter().enumerate() {
                let limits = &arm.limits()[j];
                let velocity = (now[j] - one[j]) / SAMPLE;
                let acceleration = (now[j] - 2.0 * one[j] + two[j]) / (SAMPLE * SAMPLE);
                let fast = velocity.abs() > limits.velocity * (1.0 + 1e-9);
                let hard = acceleration.abs() > limits.acceleration * (1.0 + ROUNDING);
                if fast || hard {
                    found.push(Violation {
                        knot: k,
                        kind: if hard {
                            ViolationKind::Acceleration
                        } else {
                            ViolationKind::Velocity
                        },
                        detail: format!(
                            "{name} at {time_ns} ns: sampled {velocity:.4}, {acceleration:.4}"
                        ),
                    });
                }
            }
        }
        last.push(now);
        if last.len() > 2 {
            last.remove(0);
        }
    }
    found
}

/// Exact collision checks along every segment.
fn collisions(
    plan: &Plan,
    arm: &Arm,
    world: &World,
    tick: &(dyn Fn() + Sync),
) -> (Vec<Violation>, usize) {
    let exact = world.exact();
    let lifts = lifts(plan, arm);
    let per_segment: Vec<(Option<Violation>, usize)> = (1..plan.knots.len())
        .into_par_iter()
        .map(|k| {
            let curve = plan.curve(k);
            let steps = steps(&curve, COLLISION_STEP);
            let may_touch = plan.on_surface(k) || lifts[k];
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
/// [`LIFT`] away. There it may still touch.
fn lifts(plan: &Plan, arm: &Arm) -> Vec<bool> {
    let contact = plan.tool.contact_in_tip();
    let centre =
        |k: usize| Point3::from((arm.tip_pose(&plan.knots[k].q) * contact).translation.vector);
    let mut lifts = vec![false; plan.knots.len()];
    let starts_in_contact = |k: usize| plan.knots[k].line.is_some() || k == 0;
    for k in 0..plan.knots.len() {
        if starts_in_contact(k) {
            let near = |other: usize| (centre(other) - centre(k)).norm() <= LIFT;
            let up = (k + 1..plan.knots.len()).take_while(|&n| !plan.on_surface(n) && near(n));
            up.for_each(|n| lifts[n] = true);
            let down = (1..=k).rev().take_while(|&n| !plan.on_surface(n) && near(n - 1));
            down.for_each(|n| lifts[n] = true);
        }
    }
    lifts
}

/// A pad pose on the surface and how far its centre is from the planned line.
struct Pad {
    pose: Isometry3<f64>,
    deviation: f64,
}

/// The pad along every segment on the surface, as the executor will interpolate it.
fn pad_motion(plan: &Plan, arm: &Arm) -> Vec<Pad> {
    let contact_in_tip = plan.tool.contact_in_tip();
    (1..plan.knots.len())
        .into_par_iter()
        .flat_map_iter(|k| {
            let curve = plan.curve(k);
            let line = plan.line(k - 1).zip(plan.line(k));
            let steps = if line.is_some() { steps(&curve, PAD_STEP) } else { 0 };
            let first = usize::from(k > 1 && plan.knots[k - 1].line.is_some());
            (first..=steps).filter_map(move |s| {
                let (from, to) = line?;
                let q = curve.at(s as f64 / steps as f64);
                let pose = arm.tip_pose(&q) * contact_in_tip;
                let pad = Point3::from(pose.translation.vector);
                // Between knots the pad may be a little ahead of the line's points, or behind.
                let around = [(k.checked_sub(2), k - 1), (Some(k), k + 1)];
                let deviation = around
                    .into_iter()
                    .filter_map(|(a, b)| Some((plan.line(a?)?, plan.line(b)?)))
                    .chain([(from, to)])
                    .map(|(a, b)| to_segment(&pad, &a, &b))
                    .fold(f64::INFINITY, f64::min);
                Some(Pad { pose, deviation })
            })
        })
        .collect()
}

/// The dense contact poses of the plan's motion on the surface, root frame.
#[must_use]
pub fn contact_motion(plan: &Plan, arm: &Arm) -> Vec<Isometry3<f64>> {
    pad_motion(plan, arm).into_iter().map(|p| p.pose).collect()
}

fn steps(curve: &Curve, step: f64) -> usize {
    ((curve.way() / step).ceil() as usize).max(1)
}

fn to_segment(p: &Point3<f64>, a: &Point3<f64>, b: &Point3<f64>) -> f64 {
    let along = b - a;
    let length = along.norm_squared();
    let share = if length > 0.0 { ((p - a).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
    (p - (a + along * share)).norm()
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}
