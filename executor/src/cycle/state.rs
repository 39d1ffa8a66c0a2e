//! Everything that the loop remembers from cycle to cycle, and how a plan leaves it.

use std::sync::Arc;

use heapless::Deque;
use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanId, Reason};

use super::exchange::{Output, Snapshot};
use super::watch::Watch;
use crate::JointVector;
use crate::admit::{Rejection, ValidPlan};
use crate::path::Path;

/// Plans that may wait behind the running one.
pub const WAITING: usize = 4;
/// Commanded positions that are remembered to judge the following error.
pub(super) const REMEMBERED: usize = 128;

/// A plan that waits its turn.
#[derive(Clone, Debug)]
pub(super) struct Waiting {
    pub(super) plan: Arc<ValidPlan>,
    pub(super) turn: Turn,
}

/// When a waiting plan starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Turn {
    /// When the stop that is under way is done.
    Stopped,
    /// At this knot of the running plan.
    Knot(usize),
    /// When all before it have ended.
    After,
}

/// How long the arm has been waited for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Arrival {
    /// When the last knot was commanded. \[ns\]
    pub(super) since_ns: u64,
    /// When the first of the states was measured that have the arm there without a break. \[ns\]
    pub(super) near_ns: Option<u64>,
}

/// Why the arm is stopping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StopCause {
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
    pub(super) mode: Mode,
    pub(super) fault: Fault,
    pub(super) cycle: u64,
    pub(super) missed: u64,
    pub(super) sequence: u64,
    pub(super) q: JointVector,
    pub(super) v: JointVector,
    pub(super) has_position: bool,
    pub(super) path: Option<Path>,
    /// Whether the path's plan still needs its end event; not while a fault brakes on it.
    pub(super) live: bool,
    /// The knot in which the last plan was aborted, until another one begins.
    pub(super) stopped: Option<u32>,
    /// While the arm is waited for at the path's end.
    pub(super) arrival: Option<Arrival>,
    pub(super) queue: Deque<Waiting, WAITING>,
    pub(super) stop: Option<StopCause>,
    pub(super) paused: bool,
    pub(super) scale: f64,
    pub(super) disabled: bool,
    pub(super) shutdown: bool,
    pub(super) watch: Watch,
    pub(super) remembered: [JointVector; REMEMBERED],
    pub(super) remembered_v: [JointVector; REMEMBERED],
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
            stopped: None,
            arrival: None,
            queue: Deque::new(),
            stop: None,
            paused: false,
            scale: 1.0,
            disabled: false,
            shutdown: false,
            watch: Watch::default(),
            remembered: [JointVector::ZERO; REMEMBERED],
            remembered_v: [JointVector::ZERO; REMEMBERED],
        }
    }
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
            unverified: path.is_some_and(|p| !p.plan().is_verified()),
            knot: path.map_or(0, |p| small(p.knot())),
            stopped: self.stopped.filter(|_| path.is_none()),
            plan_time_ns: path.map_or(0, |p| p.progress().time.max(0.0) as u64),
            rate: path.map_or(0.0, |p| p.progress().rate),
            scale: self.scale,
            commanded: self.q,
            refused: self.watch.refused,
            measured: self.watch.measured().map_or(JointVector::ZERO, |m| m.q),
        }
    }

    /// The number of the last setpoint.
    #[must_use]
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// Whether a shutdown was ordered.
    #[must_use]
    pub fn is_shutting_down(&self) -> bool {
        self.shutdown
    }

    /// Whether a shutdown was ordered and the arm stands still with its motors asked off.
    #[must_use]
    pub fn is_down(&self) -> bool {
        self.shutdown && self.path.is_none()
    }

    /// Whether the endpoint is asked to disable its motors: only once the arm stands still.
    pub(super) fn is_off(&self) -> bool {
        self.disabled && self.path.is_none()
    }

    /// Leaves every plan with this end.
    pub(super) fn end_all(&mut self, kind: EventKind, why: Reason, out: &mut Output) {
        self.end_path(kind, why, out);
        self.end_waiting(kind, why, out);
    }

    /// Tells the running plan's end. The path stays, to brake on.
    pub(super) fn end_path(&mut self, kind: EventKind, why: Reason, out: &mut Output) {
        if let Some(path) = self.path.as_ref().filter(|_| self.live) {
            let (knot, why) = (path.knot(), Rejection::new(why));
            let early = kind == EventKind::Aborted;
            self.stopped = early.then(|| small(knot));
            out.tell(path.plan().id(), kind, if early { why.knot(knot) } else { why });
        }
        self.live = false;
    }

    pub(super) fn end_waiting(&mut self, kind: EventKind, why: Reason, out: &mut Output) {
        while let Some(waiting) = self.queue.pop_front() {
            out.tell(waiting.plan.id(), kind, Rejection::new(why));
            out.retire(waiting.plan);
        }
    }

    pub(super) fn drop_path(&mut self, out: &mut Output) {
        if let Some(path) = self.path.take() {
            out.retire(path.into_plan());
        }
        self.live = false;
        self.arrival = None;
        self.v = JointVector::ZERO;
    }
}

pub(super) fn small(index: usize) -> u32 {
    u32::try_from(index).unwrap_or(u32::MAX)
}
