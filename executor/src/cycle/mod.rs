//! The loop's logic, one cycle at a time.
//!
//! [`step`] is a function of its arguments alone: no clock, no input or output, no heap, no
//! lock, and total over every state and event. So a recorded run replays bit for bit, and a
//! virtual clock runs millions of cycles in seconds.
//!
//! | mode | leaves it by |
//! |---|---|
//! | Init | a fresh, finite state of a calibrated, running endpoint, and commanded = measured → Hold |
//! | Hold | an accepted plan → Executing |
//! | Executing | last knot → Hold or the next plan; pause → Paused; stop, stale state, moved held joint → Stopping |
//! | Paused | resume → Executing; stop → Stopping |
//! | Stopping | stand-still → Hold, or Executing the plan that was waited for |
//! | Fault | reset (or resume after a halt), once the cause is gone → Init |
//!
//! Any mode but Init goes to Fault. The commanded position is always continued from the last
//! commanded one.

mod checkpoint;
mod command;
mod motion;
mod offer;
mod supervise;

use std::sync::Arc;

use heapless::{Deque, Vec};
use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanId, Reason};

use crate::JointVector;
use crate::admit::{Rejection, ValidPlan};
use crate::guard::Guard;
use crate::path::Path;

pub use checkpoint::{Checkpoint, MeasuredRecord};
pub use command::{Ask, Order, Reply};
pub use supervise::{HELD_MOVED, Measured};

/// Plans that may wait behind the running one.
pub const WAITING: usize = 4;
/// Most events of one cycle: every plan that is there is aborted or superseded, one is offered.
pub const EVENTS: usize = 16;
/// Commanded positions that are remembered to judge the following error.
const REMEMBERED: usize = 128;

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

/// A plan that waits its turn.
#[derive(Clone, Debug)]
struct Waiting {
    plan: Arc<ValidPlan>,
    turn: Turn,
}

/// When a waiting plan starts.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Turn {
    /// When the stop that is under way is done.
    Stopped,
    /// At this knot of the running plan.
    Knot(usize),
    /// When all before it have ended.
    After,
}

/// Why the arm is stopping.
#[derive(Clone, Copy, Debug, PartialEq)]
enum StopCause {
    /// For the plan at the head of the queue.
    Replace,
    /// By an operator's order.
    Operator,
    /// The joint state is stale, or a held joint has moved.
    Lapse(Reason),
    /// The executor shuts down.
    Shutdown,
}

/// Everything that the loop remembers from cycle to cycle.
#[derive(Clone, Debug)]
pub struct State {
    mode: Mode,
    fault: Fault,
    cycle: u64,
    missed: u64,
    sequence: u64,
    q: JointVector,
    v: JointVector,
    has_position: bool,
    path: Option<Path>,
    /// Whether the path's plan still needs its end event; not while a fault brakes on it.
    live: bool,
    queue: Deque<Waiting, WAITING>,
    stop: Option<StopCause>,
    paused: bool,
    scale: f64,
    disabled: bool,
    shutdown: bool,
    watch: supervise::Watch,
    remembered: [JointVector; REMEMBERED],
    remembered_v: [JointVector; REMEMBERED],
}

impl Default for State {
    fn default() -> Self {
        Self {
            mode: Mode::Init,
            fault: Fault::None,
            cycle: 0,
            missed: 0,
            sequence: 0,
            q: JointVector::ZERO,
            v: JointVector::ZERO,
            has_position: false,
            path: None,
            live: false,
            queue: Deque::new(),
            stop: None,
            paused: false,
            scale: 1.0,
            disabled: false,
            shutdown: false,
            watch: supervise::Watch::default(),
            remembered: [JointVector::ZERO; REMEMBERED],
            remembered_v: [JointVector::ZERO; REMEMBERED],
        }
    }
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
    /// Its knot.
    pub knot: u32,
    /// Time within it, 0 on the way to its first knot. \[ns\]
    pub plan_time_ns: u64,
    /// Speed scale in force.
    pub rate: f64,
    /// Speed scale asked for.
    pub scale: f64,
    /// Commanded positions. \[rad\] or \[m\]
    pub commanded: JointVector,
    /// Measured positions, 0 before the first state. \[rad\] or \[m\]
    pub measured: JointVector,
}

impl State {
    /// What is told about the loop.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        let path = self.path.as_ref().filter(|_| self.live);
        Snapshot {
            cycle: self.cycle,
            missed: self.missed,
            mode: self.mode,
            fault: self.fault,
            plan: path.map_or(PlanId::NONE, |p| p.plan().id()),
            knot: path.map_or(0, |p| small(p.knot())),
            plan_time_ns: path.map_or(0, |p| p.progress().time.max(0.0) as u64),
            rate: path.map_or(0.0, |p| p.progress().rate),
            scale: self.scale,
            commanded: self.q,
            measured: self.watch.measured().map_or(JointVector::ZERO, |m| m.q),
        }
    }

    /// The number of the last setpoint.
    #[must_use]
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Whether a shutdown was ordered and the arm stands still with its motors asked off.
    #[must_use]
    pub fn is_down(&self) -> bool {
        self.shutdown && self.path.is_none()
    }
}

/// One cycle. `now_ns` is the time of the wake-up on the clock of the states' stamps.
pub fn step(state: &mut State, input: Input, now_ns: u64, guard: &Guard) -> Output {
    let mut out = Output::default();
    state.cycle += 1;
    state.missed += u64::from(input.missed);
    state.supervise(input.measured, now_ns, guard, &mut out);
    if let Some(ask) = input.ask {
        state.obey(ask, now_ns, guard, &mut out);
    }
    if let Some(plan) = input.offer {
        state.consider(plan, now_ns, guard, &mut out);
    }
    state.advance(guard, &mut out);
    state.emit(guard, &mut out);
    out
}

impl State {
    /// Makes the setpoint of this cycle and remembers it.
    fn emit(&mut self, guard: &Guard, out: &mut Output) {
        if !self.has_position {
            return;
        }
        self.sequence += 1;
        let slot = (self.sequence % REMEMBERED as u64) as usize;
        self.remembered[slot] = self.q;
        self.remembered_v[slot] = self.v;
        let snapshot = self.snapshot();
        debug_assert!(self.q[guard.dof..].iter().all(|q| *q == 0.0));
        out.setpoint = Some(Target {
            sequence: self.sequence,
            q: self.q,
            v: self.v,
            plan: snapshot.plan,
            knot: snapshot.knot,
            mode: self.mode,
            disable: self.is_off(),
        });
    }

    /// Whether the endpoint is asked to disable its motors: only once the arm stands still.
    fn is_off(&self) -> bool {
        self.disabled && self.path.is_none()
    }

    /// Leaves every plan with this end.
    fn end_all(&mut self, kind: EventKind, why: Reason, out: &mut Output) {
        self.end_path(kind, why, out);
        self.end_waiting(kind, why, out);
    }

    /// Tells the running plan's end. The path stays, to brake on.
    fn end_path(&mut self, kind: EventKind, why: Reason, out: &mut Output) {
        if let Some(path) = self.path.as_ref().filter(|_| self.live) {
            out.tell(path.plan().id(), kind, Rejection::new(why));
        }
        self.live = false;
    }

    fn end_waiting(&mut self, kind: EventKind, why: Reason, out: &mut Output) {
        while let Some(waiting) = self.queue.pop_front() {
            out.tell(waiting.plan.id(), kind, Rejection::new(why));
            out.retire(waiting.plan);
        }
    }

    fn drop_path(&mut self, out: &mut Output) {
        if let Some(path) = self.path.take() {
            out.retire(path.into_plan());
        }
        self.live = false;
        self.v = JointVector::ZERO;
    }
}

impl Output {
    fn tell(&mut self, plan: PlanId, kind: EventKind, why: Rejection) {
        // Never full: see `EVENTS`.
        let told = self.events.push(Event { plan, kind, why });
        debug_assert!(told.is_ok());
    }

    fn retire(&mut self, plan: Arc<ValidPlan>) {
        if let Err(plan) = self.retired.push(plan) {
            // Never full; a leak would still be better than freeing inside the loop.
            core::mem::forget(plan);
        }
    }
}

fn small(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests;
