//! Whether one motion can go over into another: places, velocities and accelerations at the seam.

use nullsweep_ipc_types::Reason;

use crate::JointVector;
use crate::admit::{Rejection, ValidPlan};
use crate::guard::Guard;
use crate::interpolate::{ends, sample};

/// How the joints move at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Motion {
    /// \[rad/s\]
    v: JointVector,
    /// \[rad/s²\]
    a: JointVector,
}

impl Motion {
    const REST: Self = Self { v: JointVector::ZERO, a: JointVector::ZERO };

    /// How a plan leaves a knot, at full speed.
    fn from(plan: &ValidPlan, knot: usize) -> Self {
        match (plan.knots().get(knot), plan.knots().get(knot + 1)) {
            (Some(a), Some(b)) => {
                let kind = plan.interpolation();
                let v = sample(a, b, kind, a.time).v;
                Self { v, a: JointVector::from_fn(|j| ends(a, b, kind, j)[0]) }
            }
            _ => Self::REST,
        }
    }

    /// How a plan comes into a knot, at full speed: at rest into the first one, which the connector
    /// leads to.
    fn into(plan: &ValidPlan, knot: usize) -> Self {
        let before = knot.checked_sub(1).and_then(|before| plan.knots().get(before));
        match (before, plan.knots().get(knot)) {
            (Some(a), Some(b)) => {
                let kind = plan.interpolation();
                let v = sample(a, b, kind, b.time).v;
                Self { v, a: JointVector::from_fn(|j| ends(a, b, kind, j)[1]) }
            }
            _ => Self::REST,
        }
    }

    /// Velocities differ by no more than each joint may change in a cycle, accelerations by no more
    /// than its jerk limit lets them.
    fn meets(&self, after: &Self, guard: &Guard) -> Result<(), Rejection> {
        guard.matches_velocity(&self.v, &after.v).map_err(|(joint, step)| {
            let bound = guard.velocity_tolerance(joint);
            Rejection::new(Reason::Start).knot(0).joint(joint).value(step, bound)
        })?;
        for j in 0..guard.used().len() {
            guard.allows_step(j, self.a[j], after.a[j]).map_err(|shown| {
                Rejection::new(Reason::Jerk).knot(0).joint(j).value(shown.0, shown.1)
            })?;
        }
        Ok(())
    }
}

/// Whether the plan's first knot is where the arm holds.
///
/// # Errors
/// [`Reason::Start`] with the joint and by how much it is off in place \[rad\] or velocity
/// \[rad/s\], [`Reason::SoftLimit`] for a first knot too near a limit to be reached with the braking
/// margin, [`Reason::Jerk`] where its acceleration begins with too large a step.
pub fn starts_at(plan: &ValidPlan, holds: &JointVector, guard: &Guard) -> Result<(), Rejection> {
    let Some(first) = plan.knots().first() else { return Ok(()) };
    at(holds, &first.q, guard.start_tolerance, guard)?;
    // The way there must keep the braking margin. Whole turns are only of joints without one.
    for j in 0..guard.used().len() {
        if guard.approach(j, holds[j], first.q[j]).is_none() {
            let (lower, upper) = guard.joints[j].limits_at(0.0);
            let ahead = if first.q[j] > holds[j] { upper } else { lower };
            let near = Rejection::new(Reason::SoftLimit).knot(0).joint(j);
            return Err(near.value(first.q[j], ahead));
        }
    }
    // One that is already under way at its first knot cannot start from a stand-still.
    if plan.has_corners() { Ok(()) } else { Motion::REST.meets(&Motion::from(plan, 0), guard) }
}

/// Whether the plan can take over from `running` in its knot `knot`, which is at `place` \[rad\].
///
/// # Errors
/// As [`starts_at`].
pub fn joins_at(
    plan: &ValidPlan,
    running: &ValidPlan,
    knot: usize,
    place: &JointVector,
    guard: &Guard,
) -> Result<(), Rejection> {
    let Some(first) = plan.knots().first() else { return Ok(()) };
    at(place, &first.q, guard.join_tolerance, guard)?;
    let (before, after) = (Motion::into(running, knot), Motion::from(plan, 0));
    match (running.has_corners(), plan.has_corners()) {
        // A corner as bang-bang plans have them.
        (true, true) => Ok(()),
        (false, false) => before.meets(&after, guard),
        // A bang-bang plan also begins and ends at speed where the arm stands.
        (false, true) => before
            .meets(&after, guard)
            .or_else(|why| before.meets(&Motion::REST, guard).map_err(|_| why)),
        (true, false) => before
            .meets(&after, guard)
            .or_else(|why| Motion::REST.meets(&after, guard).map_err(|_| why)),
    }
}

fn at(
    place: &JointVector,
    first: &JointVector,
    tolerance: f64,
    guard: &Guard,
) -> Result<(), Rejection> {
    match guard.farthest(place, first, tolerance) {
        Some((joint, apart)) => {
            Err(Rejection::new(Reason::Start).knot(0).joint(joint).value(apart, tolerance))
        }
        None => Ok(()),
    }
}
