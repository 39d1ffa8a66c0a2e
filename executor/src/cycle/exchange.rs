//! What a cycle gets and gives: plain values, so that a run can be recorded and told.

use std::sync::Arc;

use heapless::Vec;
use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanId, Reason, Verdict};

use crate::JointVector;
use crate::admit::{Rejection, ValidPlan};

/// Most events of one cycle: every plan that is there is aborted or superseded, one is offered.
pub const EVENTS: usize = 16;
/// What a cycle gets: at most one of each.
#[derive(Clone, Debug, Default)]
pub struct Input {
    /// The newest joint state that came since the last cycle.
    pub measured: Option<Measured>,
    /// An operator's order.
    pub ask: Option<Ask>,
    /// An admitted plan.
    pub offer: Option<Arc<ValidPlan>>,
    /// Deadlines that were missed since the last cycle.
    pub missed: u32,
}

/// What a cycle gives.
#[derive(Clone, Debug, Default)]
pub struct Output {
    /// What to command, `None` until a first state tells where the arm is.
    pub setpoint: Option<Target>,
    /// What became of plans, in order.
    pub events: Vec<Event, EVENTS>,
    /// Plans that are no longer needed, to be freed elsewhere.
    pub retired: Vec<Arc<ValidPlan>, EVENTS>,
    /// The answer to the order.
    pub reply: Option<Reply>,
}

/// A setpoint, without its stamps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Rises by one each cycle.
    pub sequence: u64,
    /// \[rad\] or \[m\]
    pub q: JointVector,
    /// \[rad/s\] or \[m/s\]
    pub v: JointVector,
    /// The plan, [`PlanId::NONE`] without one.
    pub plan: PlanId,
    /// Its knot.
    pub knot: u32,
    /// The mode.
    pub mode: Mode,
    /// Whether the endpoint shall disable its motors.
    pub disable: bool,
}

/// What became of a plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Which plan.
    pub plan: PlanId,
    /// What.
    pub kind: EventKind,
    /// Why and where.
    pub why: Rejection,
}

impl core::fmt::Display for Event {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "plan {} {}", self.plan, self.kind)?;
        match self.kind {
            EventKind::Accepted => {
                write!(f, " {:.2} ms after it was published", self.why.value * 1e3)
            }
            _ if self.why.reason == Reason::None => Ok(()),
            _ => write!(f, ": {}", self.why),
        }
    }
}

/// A joint state as the loop reads it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// When it was measured. \[ns\]
    pub stamp_ns: u64,
    /// The newest setpoint that was in force then, 0 for none.
    pub setpoint_sequence: u64,
    /// How many joints the endpoint has.
    pub joint_count: usize,
    /// Measured positions. \[rad\] or \[m\]
    pub q: JointVector,
    /// Bits of [`nullsweep_ipc_types::status`], and [`HELD_MOVED`].
    pub status: u32,
}

/// States that were not taken because of their stamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Refused {
    /// How many, since the start.
    pub count: u64,
    /// When the last one came, 0 once a good one has come since. \[ns\]
    pub at_ns: u64,
    /// How far its stamp was ahead of the loop's clock. \[ns\]
    pub ahead_ns: i64,
}

/// Set in [`Measured::status`] while a held joint is not where it was when the motion began. The
/// endpoint has no say in this bit.
pub const HELD_MOVED: u32 = 1 << 31;

/// An order and a number to know its answer by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ask {
    /// Comes back in the reply.
    pub ticket: u64,
    /// What is asked.
    pub order: Order,
}

impl Ask {
    /// The ticket of what a signal asks for: nobody waits for the answer.
    pub const SIGNAL: u64 = u64::MAX;
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// Only answer.
    Status,
    /// Slow down to a stand-still on the path and keep the plan.
    Pause,
    /// Go on; after a halt or a disable, allow motion again.
    Resume,
    /// Slow down on the path, drop the plan, hold (category 2).
    Stop,
    /// As `Stop`, then ask the endpoint to disable its motors (category 1).
    StopAndDisable,
    /// Ramp the speed scale to this, 0…1.
    Speed(f64),
    /// Clear a latched fault.
    Reset,
    /// As `StopAndDisable`, and take no more plans.
    Shutdown,
}

/// How an order was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// The order's.
    pub ticket: u64,
    /// How it was taken.
    pub verdict: Verdict,
    /// The loop right after.
    pub snapshot: Snapshot,
}

/// What is told about the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// Cycles since the start.
    pub cycle: u64,
    /// Missed deadlines since the start.
    pub missed: u64,
    /// The mode.
    pub mode: Mode,
    /// The latched fault, or why the last stop was made.
    pub fault: Fault,
    /// The plan in execution.
    pub plan: PlanId,
    /// Whether that plan is one that its sender does not call verified.
    pub unverified: bool,
    /// Its knot.
    pub knot: u32,
    /// The knot in which the last plan was ended before its end, while none runs.
    pub stopped: Option<u32>,
    /// Time within it, 0 on the connector to its first knot. \[ns\]
    pub plan_time_ns: u64,
    /// Speed scale in force.
    pub rate: f64,
    /// Speed scale asked for.
    pub scale: f64,
    /// Joint states that were refused for their stamps.
    pub refused: Refused,
    /// Commanded positions. \[rad\] or \[m\]
    pub commanded: JointVector,
    /// Measured positions, 0 before the first state. \[rad\] or \[m\]
    pub measured: JointVector,
}

impl Output {
    pub(super) fn tell(&mut self, plan: PlanId, kind: EventKind, why: Rejection) {
        // Never full: see `EVENTS`.
        let told = self.events.push(Event { plan, kind, why });
        debug_assert!(told.is_ok());
    }

    pub(super) fn retire(&mut self, plan: Arc<ValidPlan>) {
        if let Err(plan) = self.retired.push(plan) {
            // Never full; a leak would still be better than freeing inside the loop.
            core::mem::forget(plan);
        }
    }
}
