//! What the loop knows as the records of a recording, and back.

use bytemuck::{Pod, Zeroable};
use nullsweep_ipc_types::{Interpolation, PlanId};
use nullsweep_recording::{CycleRecord, MeasuredRecord, PlanKnot, PlanRecord, TargetRecord};
use nullsweep_robot::JointLimits;

use crate::MAX_DOF;
use crate::admit::{Join, Shape, ValidPlan};
use crate::cycle::{Ask, Input, Measured, Order, Target};
use crate::guard::Guard;

/// A [`Guard`] as plain bytes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct GuardRecord {
    dof: u64,
    /// Lower, upper, velocity, acceleration, jerk and k_position (NaN for none), continuous (0 or
    /// 1).
    joints: [[f64; 7]; MAX_DOF],
    period_ns: u64,
    stale_ns: u64,
    lost_ns: u64,
    debounce: u64,
    settle_ns: u64,
    goal_ns: u64,
    goal_tolerance: f64,
    /// In the order of [`Guard`]'s fields.
    bounds: [f64; 7],
}

impl From<&Guard> for GuardRecord {
    fn from(g: &Guard) -> Self {
        Self {
            dof: g.dof as u64,
            joints: g.joints.map(|j| {
                let l = j.limits;
                let k = l.k_position.unwrap_or(f64::NAN);
                let continuous = f64::from(u8::from(l.continuous));
                let jerk = l.jerk.unwrap_or(f64::NAN);
                [l.lower, l.upper, l.velocity, l.acceleration, jerk, k, continuous]
            }),
            period_ns: g.period_ns,
            stale_ns: g.stale_ns,
            lost_ns: g.lost_ns,
            debounce: u64::from(g.debounce),
            settle_ns: g.settle_ns,
            goal_ns: g.goal_ns,
            goal_tolerance: g.goal_tolerance,
            bounds: [
                g.stop_acceleration,
                g.connector_acceleration,
                g.start_tolerance,
                g.join_tolerance,
                g.following_error,
                g.following_lag,
                g.min_rate,
            ],
        }
    }
}

impl From<&GuardRecord> for Guard {
    fn from(r: &GuardRecord) -> Self {
        let limits = r.joints.map(|[lower, upper, velocity, acceleration, jerk, k, continuous]| {
            let k_position = (!k.is_nan()).then_some(k);
            let jerk = (!jerk.is_nan()).then_some(jerk);
            let continuous = continuous != 0.0;
            JointLimits { lower, upper, velocity, acceleration, jerk, k_position, continuous }
        });
        let [stop, connector, start, join, following, lag, rate] = r.bounds;
        Self {
            period_ns: r.period_ns,
            stale_ns: r.stale_ns,
            lost_ns: r.lost_ns,
            debounce: u32::try_from(r.debounce).unwrap_or(u32::MAX),
            settle_ns: r.settle_ns,
            goal_ns: r.goal_ns,
            goal_tolerance: r.goal_tolerance,
            stop_acceleration: stop,
            connector_acceleration: connector,
            start_tolerance: start,
            join_tolerance: join,
            following_error: following,
            following_lag: lag,
            min_rate: rate,
            ..Self::new(&limits[..(r.dof as usize).min(MAX_DOF)])
        }
    }
}

impl From<&ValidPlan> for PlanRecord {
    fn from(plan: &ValidPlan) -> Self {
        let (join, join_plan, join_knot) = match plan.join() {
            Join::Stop => (0, PlanId::NONE, 0),
            Join::After => (1, PlanId::NONE, 0),
            Join::Knot { plan, knot } => (2, plan, knot as u64),
        };
        let interpolation = plan.interpolation().wire();
        let (id, waited) = (plan.id(), plan.waited());
        let corners = u32::from(plan.has_corners());
        let verified = u32::from(plan.is_verified());
        Self { id, join_plan, join_knot, join, interpolation, corners, verified, waited }
    }
}

/// A plan that was admitted when it was recorded.
pub(crate) fn plan(payload: &[u8]) -> Option<ValidPlan> {
    let (head, knots) = payload.split_at_checked(size_of::<PlanRecord>())?;
    let head: PlanRecord = bytemuck::pod_read_unaligned(head);
    if !knots.len().is_multiple_of(size_of::<PlanKnot>()) {
        return None;
    }
    let knots = knots.chunks(size_of::<PlanKnot>()).map(bytemuck::pod_read_unaligned).collect();
    let join = match head.join {
        0 => Join::Stop,
        1 => Join::After,
        2 => Join::Knot { plan: head.join_plan, knot: head.join_knot as usize },
        _ => return None,
    };
    let interpolation = Interpolation::from_wire(head.interpolation)?;
    let shape = Shape { interpolation, corners: head.corners != 0 };
    Some(ValidPlan::new(head.id, join, shape, head.verified != 0, knots, head.waited))
}

/// A setpoint, if there is one.
pub(crate) fn target(target: Option<&Target>) -> TargetRecord {
    target.map_or_else(TargetRecord::zeroed, |t| TargetRecord {
        sequence: t.sequence,
        q: t.q,
        v: t.v,
        plan: t.plan,
        knot: t.knot,
        mode: t.mode.wire(),
        disable: u32::from(t.disable),
        reserved: 0,
    })
}

/// What a cycle gets; its setpoint comes later.
pub(crate) fn cycle(input: &Input, now_ns: u64) -> CycleRecord {
    let (order, scale) = match input.ask.map(|a| a.order) {
        None => (0, 0.0),
        Some(Order::Status) => (1, 0.0),
        Some(Order::Pause) => (2, 0.0),
        Some(Order::Resume) => (3, 0.0),
        Some(Order::Stop) => (4, 0.0),
        Some(Order::StopAndDisable) => (5, 0.0),
        Some(Order::Speed(scale)) => (6, scale),
        Some(Order::Reset) => (7, 0.0),
        Some(Order::Shutdown) => (8, 0.0),
    };
    CycleRecord {
        now_ns,
        measured: input.measured.as_ref().map_or_else(MeasuredRecord::zeroed, Into::into),
        offer: input.offer.as_ref().map_or(PlanId::NONE, |p| p.id()),
        ticket: input.ask.map_or(0, |a| a.ticket),
        scale,
        order,
        has_measured: u32::from(input.measured.is_some()),
        missed: input.missed,
        checkpoint: 0,
        target: TargetRecord::zeroed(),
    }
}

/// What a cycle got, but for its plan. `None` where the bytes are no input.
pub(crate) fn input(record: &CycleRecord) -> Option<Input> {
    let order = match record.order {
        0 => None,
        1 => Some(Order::Status),
        2 => Some(Order::Pause),
        3 => Some(Order::Resume),
        4 => Some(Order::Stop),
        5 => Some(Order::StopAndDisable),
        6 => Some(Order::Speed(record.scale)),
        7 => Some(Order::Reset),
        8 => Some(Order::Shutdown),
        _ => return None,
    };
    Some(Input {
        measured: (record.has_measured != 0).then(|| Measured::from(&record.measured)),
        ask: order.map(|order| Ask { ticket: record.ticket, order }),
        offer: None,
        missed: record.missed,
    })
}
