//! Plans as motions over time.

use std::borrow::Cow;

use nalgebra::Isometry3;
use nullsweep_collision::Exact;
use nullsweep_planner::plan::{Plan, Profile};
use nullsweep_planner::verify::press_depths;
use nullsweep_planner::workcell::Scene;
use nullsweep_report::{Motion, Probe, Series};
use nullsweep_robot::Arm;
use rayon::prelude::*;

use super::sitter::Sitter;

/// At how many times of a plan the clearance is looked for.
const CLEARANCES: usize = 240;
/// Farthest that a clearance is told. \[m\]
pub(super) const REACH: f64 = 0.1;
/// At how many times the page's own kinematics is compared with ours.
const PROBES: usize = 60;

/// Each plan where it takes over from the one before: as it was recorded, else as it was planned. One that
/// was stopped ends where the next one says that it was left.
pub(super) fn motions(sitter: &Sitter<'_>, here: Option<&Scene>) -> anyhow::Result<Vec<Motion>> {
    let Sitter { plans, robot, arm, collision, .. } = sitter;
    let mut motions: Vec<Motion> = Vec::new();
    for (i, plan) in plans.iter().enumerate() {
        let recorded = sitter.flights.iter().find_map(|flight| flight.began(i));
        let starts_at = match (i.checked_sub(1), recorded) {
            (None, _) => 0.0,
            (_, Some((first, after))) if first < i => motions[first].starts_at + after,
            (Some(before), _) => motions[before].starts_at + taken_over(&plans[before], plan),
        };
        let left = plans.get(i + 1).and_then(|next| left_at(plan, next));
        let mut motion = motion(&until(plan, left), arm);
        motion.name = if plans.len() > 1 { format!("plan {}", i + 1) } else { "plan".into() };
        motion.starts_at = starts_at;
        if let Some(scene) = here {
            motion.series.push(press(plan, arm, scene));
            let (points, obstacles) = (scene.points(), &scene.obstacles);
            let exact = Exact::new(robot, arm, &plan.tool, points, obstacles, collision)?;
            motion.series.extend(clearances(plan, &exact));
        }
        motions.push(motion);
    }
    Ok(motions)
}

/// When a plan takes over from another one: in the knot that it goes on from, else in the last one before
/// the other was stopped, else at the other's end. \[s\]
fn taken_over(before: &Plan, plan: &Plan) -> f64 {
    let digest = before.digest().ok();
    let knot = plan.continues.as_ref().filter(|c| digest == Some(c.digest));
    let knot = knot.map(|c| c.knot as usize).or_else(|| left_at(before, plan));
    let knot = knot.and_then(|knot| before.knots.get(knot));
    knot.map_or(before.duration(), |knot| knot.time_ns as f64 * 1e-9)
}

/// The last knot of a plan that was passed before it was stopped, where the next one was made for what it
/// has left.
fn left_at(before: &Plan, next: &Plan) -> Option<usize> {
    let followed = next.past.last().filter(|_| next.continues.is_none())?;
    before.knots.starts_with(&followed.knots).then(|| followed.knots.len() - 1)
}

/// A plan up to a knot, if one is given.
fn until(plan: &Plan, knot: Option<usize>) -> Cow<'_, Plan> {
    let Some(knot) = knot else { return Cow::Borrowed(plan) };
    let mut part = plan.clone();
    part.knots.truncate(knot + 1);
    Cow::Owned(part)
}

/// A plan from its own start on.
fn motion(plan: &Plan, arm: &Arm) -> Motion {
    let (knots, dof, pad) = (&plan.knots, arm.dof(), plan.tool.on(arm));
    let each = |of: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        (0..dof).map(|j| (0..knots.len()).map(|k| of(k, j)).collect()).collect()
    };
    let times: Vec<f64> = knots.iter().map(|k| k.time_ns as f64 * 1e-9).collect();
    // Not in the middle between two knots: there a cubic and a straight line may meet.
    let probe = |k: usize| {
        let share = 0.3;
        let (from, to) = (times[k - 1], times[k]);
        let pad = pad.centre(&plan.curve(k).at(share));
        Probe { time: from + share * (to - from), pad }
    };
    let stride = knots.len().div_ceil(PROBES).max(1);
    Motion {
        joints: each(&|k, j| knots[k].q[j]),
        velocities: match plan.profile {
            Profile::Velocity => Vec::new(),
            Profile::Acceleration | Profile::Jerk => each(&|k, j| knots[k].v[j]),
        },
        contact: (0..knots.len()).map(|k| plan.on_surface(k)).collect(),
        stops: (0..knots.len() as u32).filter(|k| knots[*k as usize].patch.is_some()).collect(),
        probes: (1..knots.len()).step_by(stride).map(probe).collect(),
        times,
        ..Motion::default()
    }
}

/// How deep the pad is pressed in, knot by knot on the surface.
fn press(plan: &Plan, arm: &Arm, scene: &Scene) -> Series {
    let pad = plan.tool.on(arm);
    let on: Vec<usize> = (0..plan.knots.len()).filter(|k| plan.line(*k).is_some()).collect();
    let poses: Vec<Isometry3<f64>> = on.iter().map(|k| pad.pose(&plan.knots[*k].q)).collect();
    let mut values = vec![f64::NAN; plan.knots.len()];
    for (k, depth) in on.into_iter().zip(press_depths(scene, &poses, &plan.tool)) {
        values[k] = depth * 1e3;
    }
    let times = plan.knots.iter().map(|k| k.time_ns as f64 * 1e-9).collect();
    Series { name: "press".into(), unit: "mm", times, values, most: None }
}

/// Clearance of arm and hand at some times.
fn clearances(plan: &Plan, exact: &Exact) -> [Series; 2] {
    let stride = plan.knots.len().div_ceil(CLEARANCES).max(1);
    let at: Vec<usize> = (0..plan.knots.len()).step_by(stride).collect();
    let found: Vec<_> = at.par_iter().map(|k| exact.clearance(&plan.knots[*k].q, REACH)).collect();
    let times: Vec<f64> = at.iter().map(|k| plan.knots[*k].time_ns as f64 * 1e-9).collect();
    let mm = |of: fn(&nullsweep_collision::Clearance) -> f64| -> Vec<f64> {
        found.iter().map(|c| of(c) * 1e3).collect()
    };
    [("clearance, arm", mm(|c| c.arm)), ("clearance, hand", mm(|c| c.hand))].map(
        |(name, values)| Series {
            name: name.into(),
            unit: "mm",
            times: times.clone(),
            values,
            most: Some(REACH * 1e3),
        },
    )
}
