//! Whether one motion can go over into another: places, velocities and accelerations at the seam.

use nullsweep_ipc_types::{Interpolation, Reason};

use crate::JointVector;

use crate::admit::{Rejection, ValidPlan, passed};
use crate::guard::Guard;
use crate::interpolate::{acceleration, ends, sample};

/// Knots that may lie in the cycle that ends in a seam, and in the one that begins there, where their
/// changes have to be summed: that is done in the loop.
const CROWD: usize = 8;

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
            Rejection::new(Reason::Speed).knot(0).joint(joint).value(step, bound)
        })?;
        for j in 0..guard.used().len() {
            guard.allows_step(j, self.a[j], after.a[j]).map_err(|shown| {
                Rejection::new(Reason::Jerk).knot(0).joint(j).value(shown.0, shown.1)
            })?;
        }
        Ok(())
    }
}

/// Two motions on one time, which is 0 where the second one takes over. \[ns\]
struct Seam<'a> {
    running: &'a ValidPlan,
    /// Where it is left.
    knot: usize,
    plan: &'a ValidPlan,
}

impl Seam<'_> {
    /// Whether what is bounded within a plan is so in each cycle that has a part of both: the change
    /// of the acceleration of joints with a jerk limit, or of the velocity where both are straight.
    fn check(&self, guard: &Guard) -> Result<(), Rejection> {
        let straight =
            [self.running, self.plan].map(|p| p.interpolation() == Interpolation::Linear);
        let straight = straight == [true; 2];
        let counts = |j: usize| straight || guard.joints[j].limits.jerk.is_some();
        let joints = guard.used().len();
        if !(0..joints).any(counts) {
            return Ok(());
        }
        let cycle = guard.period_ns as f64 - if straight { 1.0 } else { 0.0 };
        let left = self.left_at();
        let behind = self.running.times().get(..=self.knot).unwrap_or_default();
        let behind = behind.iter().rev().map(|t| t - left).take_while(|t| *t >= -cycle);
        let ahead = self.plan.times().iter().skip(1).copied().take_while(|t| *t <= cycle);
        let close =
            behind.clone().take(CROWD + 1).count().max(ahead.clone().take(CROWD + 1).count());
        if close > CROWD {
            return Err(Rejection::new(Reason::Malformed)
                .knot(0)
                .value(close as f64, CROWD as f64));
        }
        for knot in behind.chain(ahead) {
            for begin in [knot - cycle, knot] {
                // Others have a part of one alone.
                if !(-cycle..=0.0).contains(&begin) {
                    continue;
                }
                for just_after in [false, true] {
                    for j in (0..joints).filter(|&j| counts(j)) {
                        let [from, to] =
                            [begin, begin + cycle].map(|at| self.at(at, just_after, straight, j));
                        self.allows(guard, straight, j, from, to)?;
                    }
                }
            }
        }
        Ok(())
    }

    fn allows(
        &self,
        guard: &Guard,
        straight: bool,
        j: usize,
        from: f64,
        to: f64,
    ) -> Result<(), Rejection> {
        if !straight {
            return guard.allows_step(j, from, to).map_err(|(shown, most)| {
                Rejection::new(Reason::Jerk).knot(0).joint(j).value(shown, most)
            });
        }
        let (step, bound) = ((to - from).abs(), guard.velocity_tolerance(j));
        if step <= bound {
            return Ok(());
        }
        Err(Rejection::new(Reason::Speed).knot(0).joint(j).value(step, bound))
    }

    /// When the running plan is left, on its own time. \[ns\]
    fn left_at(&self) -> f64 {
        self.running.times().get(self.knot).copied().unwrap_or(0.0)
    }

    /// A joint's acceleration \[rad/s²\], or its velocity where both are `straight` \[rad/s\].
    fn at(&self, time: f64, just_after: bool, straight: bool, j: usize) -> f64 {
        let is_old = time < 0.0 || time == 0.0 && !just_after;
        let (plan, time) =
            if is_old { (self.running, time + self.left_at()) } else { (self.plan, time) };
        let (kind, knots) = (plan.interpolation(), plan.knots());
        let behind = passed(plan.times(), time, just_after);
        match (behind.checked_sub(1).and_then(|k| knots.get(k)), knots.get(behind)) {
            (Some(a), Some(b)) if straight => (b.q[j] - a.q[j]) / ((b.time - a.time) * 1e-9),
            (Some(a), Some(b)) => acceleration(a, b, kind, j, time),
            _ => 0.0,
        }
    }
}

/// Whether the plan's first knot is where the arm holds.
///
/// # Errors
/// [`Reason::Start`] with the joint and by how much it is off in place \[rad\], [`Reason::Speed`] the
/// same in velocity \[rad/s\], [`Reason::SoftLimit`] for a first knot too near a limit to be reached
/// with the braking margin, [`Reason::Jerk`] where its acceleration begins with too large a step.
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
/// As [`starts_at`]; [`Reason::Malformed`] with the number of knots where too many of them are in the
/// cycle before or after the seam to be summed there.
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
        (false, false) => {
            before.meets(&after, guard)?;
            Seam { running, knot, plan }.check(guard)
        }
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
