//! Admission: from untrusted bytes to a plan that cannot be wrong.
//!
//! Runs on the worker thread, on a private copy of what the publisher sent. What depends on the
//! moment (where the arm holds, whether the knot to join has passed) is judged later by the
//! loop, in [`crate::cycle`].

mod motion;
mod plan;
mod rejection;

use nullsweep_ipc_types::{
    Interpolation, JoinRule, Knot, MAX_HELD_JOINTS, MAX_KNOTS, PlanHeader, PlanMessage, Reason,
    checksum,
};

use crate::guard::Guard;
use crate::interpolate::{PlanKnot, top_speed};
use crate::total::{greater, within};
use crate::{JointVector, MAX_DOF};
use motion::{check_corners, check_end, check_jerk, check_segments};

pub(crate) use motion::passed;
pub(crate) use plan::Shape;
pub use plan::{Join, ValidPlan};
pub use rejection::Rejection;

/// The rate of plan time never changes faster than from 0 to 1 in 20 ms, nor slower than in 1 s.
const RAMP: (f64, f64) = (1.0, 50.0);

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
    /// How far a held joint may be from where the plan takes it, see [`Guard::HELD_TOLERANCE`]. \[rad\]
    /// or \[m\]
    pub held_tolerance: f64,
    /// When this executor started. \[ns\]
    pub since_ns: u64,
}

/// Checks a private copy of a plan. `held` is where the held joints stand now, `None` while no
/// state has come.
///
/// # Errors
/// The first rule that it breaks, in this order: counts and enum values, checksum, epoch, robot,
/// held joints, finite values, time order, soft limits, velocity, acceleration and jerk, rest at
/// the end, corners.
pub fn admit(
    header: &PlanHeader,
    knots: &[Knot],
    held: Option<&Held>,
    rules: &Rules,
    now_ns: u64,
) -> Result<ValidPlan, Rejection> {
    let (shape, join) = shape(header, knots)?;
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
    let mut plan =
        ValidPlan::new(header.id, join, shape, header.verified != 0, read(knots, joints)?, 0.0);
    check_segments(&plan, &rules.guard)?;
    check_jerk(&plan, &rules.guard)?;
    check_end(&plan, &rules.guard)?;
    check_corners(&plan, &rules.guard)?;
    set_ramps(&mut plan, &rules.guard);
    Ok(plan)
}

/// Counts and enum values.
fn shape(header: &PlanHeader, knots: &[Knot]) -> Result<(Shape, Join), Rejection> {
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
    let corners = header.corners != 0 && interpolation == Interpolation::Linear;
    Ok((Shape { interpolation, corners }, join))
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

/// Gives each knot the steepest change of rate that is safe from its segment to one cycle past
/// it, so that the loop need not look ahead. A sliding minimum, from the end.
fn set_ramps(plan: &mut ValidPlan, guard: &Guard) {
    let count = plan.knots.len();
    let alone: Vec<f64> = plan
        .knots
        .windows(2)
        .map(|pair| {
            let top = (0..guard.dof)
                .map(|j| top_speed(&pair[0], &pair[1], plan.interpolation(), j))
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

#[cfg(test)]
mod tests;
