//! Admission: from untrusted bytes to a plan that cannot be wrong.
//!
//! Runs on the worker thread, on a private copy of what the publisher sent. What depends on the
//! moment (where the arm holds, whether the knot to join has passed) is judged later by the
//! loop, in [`crate::cycle`].

use core::fmt;

use nullsweep_ipc_types::{
    Interpolation, JoinRule, Knot, MAX_HELD_JOINTS, MAX_KNOTS, PlanHeader, PlanId, PlanMessage,
    Reason, checksum,
};

use crate::guard::Guard;
use crate::interpolate::{PlanKnot, reach, top_acceleration, top_speed};
use crate::total::{greater, within};
use crate::{JointVector, MAX_DOF};

/// A planner rounds its times to whole nanoseconds, so a segment may be this much too short. \[s\]
const ROUNDING_S: f64 = 1e-9;
/// What a planner's acceleration may exceed its limit by, as a share of it.
const ROUNDING_SHARE: f64 = 1e-6;
/// Room for the rounding of positions. \[rad\]
const SLACK: f64 = 1e-9;
/// The rate of plan time never changes faster than from 0 to 1 in 20 ms, nor slower than in 1 s.
const RAMP: (f64, f64) = (1.0, 50.0);

/// How a plan joins the motion that is going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Join {
    /// Stop on the path, then start.
    Stop,
    /// Start when what runs and waits has ended.
    After,
    /// Start in a knot of the running plan.
    Knot {
        /// The running plan.
        plan: PlanId,
        /// Its knot.
        knot: usize,
    },
}

/// A plan that has passed every check that does not depend on the moment. Its fields are
/// private and nothing changes it, so the loop need not look again.
#[derive(Debug, PartialEq)]
pub struct ValidPlan {
    id: PlanId,
    join: Join,
    interpolation: Interpolation,
    knots: Vec<PlanKnot>,
    /// The knots' times once more, close together, to be searched.
    times: Vec<f64>,
    waited: f64,
}

impl ValidPlan {
    /// A plan that was checked.
    pub(crate) fn new(
        id: PlanId,
        join: Join,
        interpolation: Interpolation,
        knots: Vec<PlanKnot>,
        waited: f64,
    ) -> Self {
        let times = knots.iter().map(|k| k.time).collect();
        Self { id, join, interpolation, knots, times, waited }
    }

    /// The time from its publication to the end of its check, which the loop tells with its
    /// acceptance. \[s\]
    #[must_use]
    pub fn waited(&self) -> f64 {
        self.waited
    }

    /// Notes that the check is done.
    pub(crate) fn checked(mut self, now_ns: u64) -> Self {
        self.waited = now_ns.saturating_sub(self.id.epoch) as f64 * 1e-9;
        self
    }

    /// Names it.
    #[must_use]
    pub fn id(&self) -> PlanId {
        self.id
    }

    /// How it joins.
    #[must_use]
    pub fn join(&self) -> Join {
        self.join
    }

    /// How to move between knots.
    #[must_use]
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// At least two knots, times from 0 and rising strictly.
    #[must_use]
    pub fn knots(&self) -> &[PlanKnot] {
        &self.knots
    }

    /// The knots' times. \[ns\]
    pub(crate) fn times(&self) -> &[f64] {
        &self.times
    }

    /// How long it takes at full speed. \[ns\]
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.knots.last().map_or(0.0, |k| k.time)
    }
}

/// Why a plan was not admitted, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rejection {
    /// The rule that it breaks.
    pub reason: Reason,
    /// The joint, or held joint, `u32::MAX` for none.
    pub joint: u32,
    /// The knot, `u32::MAX` for none.
    pub knot: u32,
    /// The offending value, NaN for none.
    pub value: f64,
    /// The bound that it broke, NaN for none.
    pub bound: f64,
}

impl Rejection {
    /// A rejection without a place.
    #[must_use]
    pub fn new(reason: Reason) -> Self {
        Self { reason, joint: u32::MAX, knot: u32::MAX, value: f64::NAN, bound: f64::NAN }
    }

    /// With the value and its bound.
    #[must_use]
    pub fn value(self, value: f64, bound: f64) -> Self {
        Self { value, bound, ..self }
    }

    /// At a joint.
    #[must_use]
    pub fn joint(self, joint: usize) -> Self {
        Self { joint: small(joint), ..self }
    }

    /// At a knot.
    #[must_use]
    pub fn knot(self, knot: usize) -> Self {
        Self { knot: small(knot), ..self }
    }
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.reason)?;
        if self.knot != u32::MAX {
            write!(f, ", knot {}", self.knot)?;
        }
        if self.joint != u32::MAX {
            write!(f, ", joint {}", self.joint)?;
        }
        if !self.value.is_nan() || !self.bound.is_nan() {
            write!(f, ": {} against {}", self.value, self.bound)?;
        }
        Ok(())
    }
}

/// Where the joints stand that a plan takes as fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Measured positions, URDF order. \[rad\] or \[m\]
    pub positions: [f64; MAX_HELD_JOINTS],
    /// How many are used.
    pub count: usize,
}

/// What a plan is checked against.
#[derive(Clone, Debug)]
pub struct Rules {
    /// The executor's own bounds.
    pub guard: Guard,
    /// Fingerprint of the executor's own robot and arm.
    pub fingerprint: u64,
    /// For each held joint whether whole turns make no difference.
    pub held_continuous: Vec<bool>,
    /// How far a held joint may be from where the plan takes it. \[rad\] or \[m\]
    pub held_tolerance: f64,
    /// When this executor started. \[ns\]
    pub since_ns: u64,
}

impl Rules {
    /// Default of [`Self::held_tolerance`]. \[rad\] or \[m\]
    pub const HELD_TOLERANCE: f64 = 0.01;
}

/// Checks a private copy of a plan. `held` is where the held joints stand now, `None` while no
/// state has come.
///
/// # Errors
/// The first rule that it breaks, in this order: counts and enum values, checksum, epoch, robot,
/// held joints, finite values, time order, soft limits, velocity and acceleration, rest at the end.
pub fn admit(
    header: &PlanHeader,
    knots: &[Knot],
    held: Option<&Held>,
    rules: &Rules,
    now_ns: u64,
) -> Result<ValidPlan, Rejection> {
    let (interpolation, join) = shape(header, knots)?;
    if checksum(PlanMessage { header, knots }) != header.checksum {
        return Err(Rejection::new(Reason::Checksum));
    }
    if !(rules.since_ns..=now_ns).contains(&header.id.epoch) {
        let (epoch, start) = (header.id.epoch as f64, rules.since_ns as f64);
        return Err(Rejection::new(Reason::Epoch).value(epoch, start));
    }
    let joints = header.joint_count as usize;
    if header.fingerprint != rules.fingerprint || joints != rules.guard.dof {
        let same = header.fingerprint == rules.fingerprint;
        let bound = if same { rules.guard.dof as f64 } else { f64::NAN };
        let value = if same { joints as f64 } else { f64::NAN };
        return Err(Rejection::new(Reason::Robot).value(value, bound));
    }
    check_held(header, held, rules)?;
    let mut plan = ValidPlan::new(header.id, join, interpolation, read(knots, joints)?, 0.0);
    check_motion(&plan, &rules.guard)?;
    check_end(&plan, &rules.guard)?;
    set_ramps(&mut plan, &rules.guard);
    Ok(plan)
}

/// Counts and enum values.
fn shape(header: &PlanHeader, knots: &[Knot]) -> Result<(Interpolation, Join), Rejection> {
    let malformed = Rejection::new(Reason::Malformed);
    if !(2..=MAX_KNOTS).contains(&knots.len()) {
        return Err(malformed.value(knots.len() as f64, MAX_KNOTS as f64));
    }
    if header.knot_count as usize != knots.len() {
        return Err(malformed.value(f64::from(header.knot_count), knots.len() as f64));
    }
    if !(1..=MAX_DOF).contains(&(header.joint_count as usize)) {
        return Err(malformed.value(f64::from(header.joint_count), MAX_DOF as f64));
    }
    if header.held_count as usize > MAX_HELD_JOINTS {
        return Err(malformed.value(f64::from(header.held_count), MAX_HELD_JOINTS as f64));
    }
    if !header.id.is_some() {
        return Err(malformed);
    }
    let interpolation = Interpolation::from_wire(header.interpolation).ok_or(malformed)?;
    let join = match JoinRule::from_wire(header.join_rule).ok_or(malformed)? {
        JoinRule::StopThenStart => Join::Stop,
        JoinRule::AfterCurrent => Join::After,
        JoinRule::AtKnot => Join::Knot { plan: header.join_plan, knot: header.join_knot as usize },
    };
    Ok((interpolation, join))
}

fn check_held(header: &PlanHeader, held: Option<&Held>, rules: &Rules) -> Result<(), Rejection> {
    let Some(held) = held else { return Err(Rejection::new(Reason::NotReady)) };
    let count = rules.held_continuous.len();
    let rejection = Rejection::new(Reason::HeldJoint);
    // First the plan's count, then the endpoint's.
    for given in [header.held_count as usize, held.count] {
        if given != count {
            return Err(rejection.joint(given.min(count)).value(given as f64, count as f64));
        }
    }
    for (i, continuous) in rules.held_continuous.iter().enumerate() {
        let (planned, stands) = (header.held_positions[i], held.positions[i]);
        let mut apart = (planned - stands).abs();
        if *continuous {
            apart %= core::f64::consts::TAU;
            apart = apart.min(core::f64::consts::TAU - apart);
        }
        if !(apart <= rules.held_tolerance) {
            return Err(rejection.joint(i).value(planned, stands));
        }
    }
    Ok(())
}

/// Knots as the loop reads them: finite, times from 0 and rising strictly.
fn read(knots: &[Knot], joints: usize) -> Result<Vec<PlanKnot>, Rejection> {
    let mut read: Vec<PlanKnot> = Vec::with_capacity(knots.len());
    for (i, knot) in knots.iter().enumerate() {
        let mut own = PlanKnot {
            time: knot.time_from_start_ns as f64,
            q: JointVector::ZERO,
            v: JointVector::ZERO,
            ramp: RAMP.0,
        };
        for j in 0..joints {
            for (to, from) in
                [(&mut own.q[j], knot.positions[j]), (&mut own.v[j], knot.velocities[j])]
            {
                if !from.is_finite() {
                    return Err(Rejection::new(Reason::NotFinite)
                        .knot(i)
                        .joint(j)
                        .value(from, f64::NAN));
                }
                *to = from;
            }
            // A bound that holds also for joints that turn without end.
            if !(own.q[j].abs() <= Knot::FARTHEST) {
                let far = Rejection::new(Reason::SoftLimit).knot(i).joint(j);
                return Err(far.value(own.q[j], Knot::FARTHEST.copysign(own.q[j])));
            }
        }
        let order = Rejection::new(Reason::TimeOrder).knot(i);
        match read.last() {
            None if own.time != 0.0 => return Err(order.value(own.time, 0.0)),
            Some(last) if own.time <= last.time => return Err(order.value(own.time, last.time)),
            _ if knot.time_from_start_ns > Knot::LATEST_NS => {
                return Err(order.value(own.time, Knot::LATEST_NS as f64));
            }
            _ => read.push(own),
        }
    }
    Ok(read)
}

/// Soft limits with the braking margin at each segment's speed, velocity limits, and acceleration
/// limits within curves. A straight segment's corners are bang-bang, and that is allowed.
fn check_motion(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    for (i, pair) in plan.knots.windows(2).enumerate() {
        let (a, b) = (&pair[0], &pair[1]);
        let seconds = (b.time - a.time) * 1e-9;
        for (j, bound) in guard.used().iter().enumerate() {
            let speed = top_speed(a, b, plan.interpolation, j);
            let fits = speed * seconds <= bound.velocity() * (seconds + ROUNDING_S) + SLACK;
            let (low, high) = reach(a, b, plan.interpolation, j);
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
            let (hardest, most) =
                (top_acceleration(a, b, plan.interpolation, j), bound.limits.acceleration);
            if !(hardest <= most * (1.0 + ROUNDING_SHARE) + SLACK) {
                return Err(at(Reason::Acceleration).value(hardest, most));
            }
        }
    }
    Ok(())
}

/// A curve must come to rest: after its last knot the arm holds.
fn check_end(plan: &ValidPlan, guard: &Guard) -> Result<(), Rejection> {
    let Some(last) = plan.knots.last().filter(|_| plan.interpolation == Interpolation::Cubic)
    else {
        return Ok(());
    };
    guard.matches_velocity(&last.v, &JointVector::ZERO).map_err(|(joint, speed)| {
        Rejection::new(Reason::Velocity)
            .knot(plan.knots.len() - 1)
            .joint(joint)
            .value(speed, guard.velocity_tolerance(joint))
    })
}

/// Gives each knot the steepest change of rate that is safe from its segment to one cycle past
/// it, so that the loop need not look ahead. A sliding minimum, from the end.
fn set_ramps(plan: &mut ValidPlan, guard: &Guard) {
    let count = plan.knots.len();
    let alone: Vec<f64> = plan
        .knots
        .windows(2)
        .map(|pair| {
            let top = (0..guard.dof)
                .map(|j| top_speed(&pair[0], &pair[1], plan.interpolation, j))
                .fold(0.0, greater);
            within(guard.stop_acceleration / top, RAMP.0, RAMP.1)
        })
        .collect();
    // Indices of segments whose ramp is smaller than that of all before them in the window.
    let mut window = std::collections::VecDeque::new();
    for i in (0..count - 1).rev() {
        let end = plan.knots[i + 1].time + guard.period_ns as f64;
        while window.front().is_some_and(|&k: &usize| alone[k] >= alone[i]) {
            window.pop_front();
        }
        window.push_front(i);
        while window.back().is_some_and(|&k| plan.knots[k].time > end) {
            window.pop_back();
        }
        plan.knots[i].ramp = window.back().map_or(RAMP.0, |&k| alone[k]);
    }
    plan.knots[count - 1].ramp = alone[count - 2];
}

fn small(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests;
