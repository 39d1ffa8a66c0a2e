//! Does an admitted plan fit the moment? The join rules.
//!
//! Whatever can be known before the running plan is touched is judged here, so that a plan that
//! does not fit leaves it alone: where a stop will end is predicted with the very arithmetic of
//! the stop.

use std::sync::Arc;

use nullsweep_ipc_types::{EventKind, Fault, Mode, PlanId, Reason};

use super::exchange::Output;
use super::state::{State, StopCause, Turn, Waiting};
use crate::admit::{Join, Rejection, ValidPlan};
use crate::fit::{joins_at, starts_at};
use crate::guard::Guard;
use crate::path::Path;

impl State {
    /// Accepts or rejects a plan, with exactly one event for it.
    pub(super) fn consider(
        &mut self,
        plan: Arc<ValidPlan>,
        now_ns: u64,
        guard: &Guard,
        out: &mut Output,
    ) {
        let id = plan.id();
        let turn = match self.turn(&plan, now_ns, guard) {
            Ok(turn) => turn,
            Err(why) => {
                out.tell(id, EventKind::Rejected, why);
                out.retire(plan);
                return;
            }
        };
        let waited = Rejection::new(Reason::None).value(plan.waited(), plan.duration() * 1e-9);
        out.tell(id, EventKind::Accepted, waited);
        self.fault = Fault::None;
        let Some(turn) = turn else {
            self.begin(plan, self.scale, guard, out);
            return;
        };
        if turn != Turn::After {
            // The newest plan wins over what waited for its turn.
            self.end_waiting(EventKind::Superseded, Reason::None, out);
        }
        if turn == Turn::Stopped {
            self.stop = Some(StopCause::Replace);
            self.mode = Mode::Stopping;
        }
        // There is room: `turn` has looked, or the queue has just been emptied.
        if let Err(waiting) = self.queue.push_back(Waiting { plan, turn }) {
            out.tell(id, EventKind::Aborted, Rejection::new(Reason::QueueFull));
            out.retire(waiting.plan);
        }
    }

    /// Starts a plan from where the arm holds.
    pub(super) fn begin(
        &mut self,
        plan: Arc<ValidPlan>,
        rate: f64,
        guard: &Guard,
        out: &mut Output,
    ) {
        out.tell(plan.id(), EventKind::Started, Rejection::new(Reason::None));
        self.path = Some(Path::start(plan, &self.q, rate, guard));
        self.live = true;
        self.mode = Mode::Executing;
    }

    /// When the plan's turn comes, `None` for at once.
    fn turn(
        &self,
        plan: &ValidPlan,
        now_ns: u64,
        guard: &Guard,
    ) -> Result<Option<Turn>, Rejection> {
        let not_ready = Rejection::new(Reason::NotReady);
        let stale = self.watch.age(now_ns) >= guard.stale_ns;
        let leaving = !matches!(self.stop, None | Some(StopCause::Replace));
        if self.disabled || self.shutdown || stale || leaving {
            return Err(not_ready);
        }
        match (self.mode, self.path.as_ref()) {
            (Mode::Init | Mode::Fault, _) => Err(not_ready),
            (_, None) => match plan.join() {
                Join::Knot { .. } => Err(Rejection::new(Reason::JoinPlan)),
                Join::Stop | Join::After => starts_at(plan, &self.q, guard).map(|()| None),
            },
            (_, Some(path)) => match plan.join() {
                Join::Stop => {
                    let holds = path.predict_stop(guard).ok_or(not_ready)?;
                    starts_at(plan, &holds, guard).map(|()| Some(Turn::Stopped))
                }
                Join::After => self.after(plan, path, guard).map(|()| Some(Turn::After)),
                Join::Knot { plan: joined, knot } => {
                    self.at_knot(plan, path, joined, knot, guard).map(|()| Some(Turn::Knot(knot)))
                }
            },
        }
    }

    fn after(&self, plan: &ValidPlan, path: &Path, guard: &Guard) -> Result<(), Rejection> {
        if self.queue.is_full() {
            return Err(Rejection::new(Reason::QueueFull));
        }
        let last = self.queue.back().and_then(|w| w.plan.knots().last());
        let holds = last.map_or_else(|| path.end(), |k| k.q);
        starts_at(plan, &holds, guard)
    }

    fn at_knot(
        &self,
        plan: &ValidPlan,
        path: &Path,
        joined: PlanId,
        knot: usize,
        guard: &Guard,
    ) -> Result<(), Rejection> {
        if self.stop.is_some() || path.plan().id() != joined {
            return Err(Rejection::new(Reason::JoinPlan));
        }
        let passed = Rejection::new(Reason::JoinKnot).value(knot as f64, path.knot() as f64);
        let at = path.upcoming(knot).ok_or(passed)?;
        joins_at(plan, path.plan(), knot, &at.q, guard)
    }
}
