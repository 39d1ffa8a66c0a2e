//! The finished plan, checked again by code that shares nothing with the search: a plan that
//! fails is never published.

use nalgebra::{Isometry3, Point3};
use nullsweep_robot::{Arm, JointVector, MAX_DOF};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::collision::{ToolContact, World};
use crate::coverage;
use crate::plan::Plan;
use crate::scan::Scan;
use crate::surface::Surface;

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
        if knot.q.iter().any(|v| !v.is_finite()) {
            report(k, ViolationKind::NotFinite, format!("{:?}", knot.q));
        }
        let before = k.checked_sub(1).map(|b| &plan.knots[b]);
        let rises = before.map_or(knot.time_ns == 0, |b| knot.time_ns > b.time_ns);
        if !rises {
            report(k, ViolationKind::TimeOrder, format!("time {} ns", knot.time_ns));
            continue;
        }
        for (j, name) in arm.joint_names().iter().enumerate() {
            let velocity = before
                .map_or(0.0, |b| (knot.q[j] - b.q[j]) / ((knot.time_ns - b.time_ns) as f64 * 1e-9));
            let limit = arm.limits()[j].velocity;
            if velocity.abs() > limit * (1.0 + 1e-9) {
                let detail = format!("{name}: {velocity:.4} of {limit:.4}");
                report(k, ViolationKind::Velocity, detail);
            }
            let (low, high) = arm.braking_limits(j, velocity);
            if !(low..=high).contains(&knot.q[j]) {
                let detail = format!("{name}: {:.4} outside {low:.4} … {high:.4}", knot.q[j]);
                report(k, ViolationKind::SoftLimit, detail);
            }
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
            let (a, b) = (&plan.knots[k - 1], &plan.knots[k]);
            let steps = steps(&a.q, &b.q, COLLISION_STEP);
            let may_touch = plan.on_surface(k) || lifts[k];
            let contact = if may_touch { ToolContact::Allowed } else { ToolContact::Forbidden };
            let hit = (1..=steps).find_map(|s| {
                let q = between(&a.q, &b.q, s as f64 / steps as f64);
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
            let (a, b) = (&plan.knots[k - 1], &plan.knots[k]);
            let line = plan.line(k - 1).zip(plan.line(k));
            let steps = if line.is_some() { steps(&a.q, &b.q, PAD_STEP) } else { 0 };
            let first = usize::from(k > 1 && plan.knots[k - 1].line.is_some());
            (first..=steps).filter_map(move |s| {
                let (from, to) = line?;
                let q = between(&a.q, &b.q, s as f64 / steps as f64);
                let pose = arm.tip_pose(&q) * contact_in_tip;
                let deviation = to_segment(&Point3::from(pose.translation.vector), &from, &to);
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

fn steps(a: &JointVector, b: &JointVector, step: f64) -> usize {
    let farthest = (0..MAX_DOF).map(|j| (b[j] - a[j]).abs()).fold(0.0, f64::max);
    ((farthest / step).ceil() as usize).max(1)
}

fn between(a: &JointVector, b: &JointVector, share: f64) -> JointVector {
    std::array::from_fn(|j| a[j] + share * (b[j] - a[j]))
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
