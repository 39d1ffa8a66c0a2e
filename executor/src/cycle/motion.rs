//! One cycle of motion along the path, and the last look at what it commands.

use std::sync::Arc;

use nullsweep_ipc_types::{EventKind, Fault, Mode, Reason};

use super::exchange::Output;
use super::state::{State, StopCause, Turn};
use crate::JointVector;
use crate::admit::{Rejection, ValidPlan};
use crate::fit::starts_at;
use crate::guard::Guard;
use crate::interpolate::Sample;
use crate::path::Path;

/// Room for rounding in the bound on a step: relative, and absolute. \[rad\]
const STEP_SLACK: (f64, f64) = (1e-6, 1e-9);
/// Room for rounding at a soft limit. \[rad\]
const LIMIT_SLACK: f64 = 1e-6;

impl State {
    /// Moves the commanded position on by one cycle.
    pub(super) fn advance(&mut self, now_ns: u64, guard: &Guard, out: &mut Output) {
        let go = self.stop.is_none() && !self.paused && self.mode != Mode::Fault;
        let target = if go { self.scale } else { 0.0 };
        let Some(path) = self.path.as_mut() else {
            self.v = JointVector::ZERO;
            return;
        };
        path.advance(target, guard);
        self.join_at_knot(guard, out);
        let Some(path) = self.path.as_ref() else { return };
        let mut sample = path.sample();
        let ended = path.ended();
        let still = path.progress().rate <= 0.0;
        if ended || still {
            sample.v = JointVector::ZERO;
        }
        if let Err(fault) = self.allows(&sample, guard) {
            self.freeze(fault, out);
            return;
        }
        self.q = sample.q;
        self.v = sample.v;
        if ended {
            self.arrive(now_ns, guard, out);
        } else if still {
            self.stand(guard, out);
        } else if self.mode == Mode::Paused {
            // Not yet, or no longer: a resume has begun to speed up.
            self.mode = Mode::Executing;
        }
    }

    /// Changes over to the plan that waits for a knot which has been reached.
    fn join_at_knot(&mut self, guard: &Guard, out: &mut Output) {
        let Some(path) = self.path.as_ref().filter(|_| self.live && self.stop.is_none()) else {
            return;
        };
        let Some(Turn::Knot(knot)) = self.queue.front().map(|w| w.turn) else { return };
        let Some(at) = path.knot_at(knot) else { return };
        let now = path.progress();
        if now.time < at.time {
            return;
        }
        let Some(waiting) = self.queue.pop_front() else { return };
        self.end_path(EventKind::Superseded, Reason::None, out);
        out.tell(waiting.plan.id(), EventKind::Started, Rejection::new(Reason::None));
        let joined = Path::join(waiting.plan, &at.q, now.time - at.time, now.rate, guard);
        if let Some(old) = self.path.replace(joined) {
            out.retire(old.into_plan());
        }
        self.live = true;
    }

    /// The arm rests at the last knot.
    pub(super) fn finish(&mut self, guard: &Guard, out: &mut Output) {
        let rate = self.path.as_ref().map_or(0.0, |p| p.progress().rate);
        self.end_path(EventKind::Finished, Reason::None, out);
        self.drop_path(out);
        self.mode = Mode::Hold;
        if let Some(next) = self.queue.pop_front() {
            self.start_waiting(next.plan, rate, guard, out);
        } else {
            self.paused = false;
        }
    }

    /// The rate is 0.
    fn stand(&mut self, guard: &Guard, out: &mut Output) {
        if self.stop.is_some() || self.mode == Mode::Fault {
            self.come_to_rest(guard, out);
        } else if self.paused {
            self.mode = Mode::Paused;
        }
    }

    /// The stop is done: the path ends here.
    pub(super) fn come_to_rest(&mut self, guard: &Guard, out: &mut Output) {
        let stop = self.stop.take();
        let (kind, why) = match stop {
            Some(StopCause::Replace) => (EventKind::Superseded, Reason::None),
            Some(StopCause::Operator) => (EventKind::Aborted, Reason::Stopped),
            Some(StopCause::Shutdown) => (EventKind::Aborted, Reason::Shutdown),
            Some(StopCause::Lapse(why)) => (EventKind::Aborted, why),
            None => (EventKind::Aborted, Reason::Fault),
        };
        self.end_path(kind, why, out);
        self.drop_path(out);
        if self.mode == Mode::Fault {
            return;
        }
        self.mode = Mode::Hold;
        match self.queue.pop_front() {
            Some(next) if stop == Some(StopCause::Replace) => {
                let rate = if self.paused { 0.0 } else { self.scale };
                self.start_waiting(next.plan, rate, guard, out);
            }
            Some(next) => {
                out.tell(next.plan.id(), EventKind::Aborted, Rejection::new(why));
                out.retire(next.plan);
            }
            None => self.paused = false,
        }
    }

    /// Starts a plan that was accepted earlier, if it still fits.
    fn start_waiting(&mut self, plan: Arc<ValidPlan>, rate: f64, guard: &Guard, out: &mut Output) {
        match starts_at(&plan, &self.q, guard) {
            Ok(()) => self.begin(plan, rate, guard, out),
            Err(why) => {
                out.tell(plan.id(), EventKind::Aborted, why);
                out.retire(plan);
                // What waits behind it was to start at its end.
                self.end_waiting(EventKind::Aborted, Reason::Start, out);
                self.paused = false;
            }
        }
    }

    /// The last look: finite, no step beyond v·T, nothing that leaves the soft limits.
    fn allows(&self, sample: &Sample, guard: &Guard) -> Result<(), Fault> {
        for (j, bound) in guard.used().iter().enumerate() {
            let (from, to) = (self.q[j], sample.q[j]);
            if !to.is_finite() || !sample.v[j].is_finite() {
                return Err(Fault::NotFinite);
            }
            let step = (to - from).abs();
            let most = bound.velocity() * guard.period() * (1.0 + STEP_SLACK.0) + STEP_SLACK.1;
            if !(step <= most) {
                return Err(Fault::Step);
            }
            // Coming back in from outside is allowed.
            let (lower, upper) = bound.limits_at(sample.v[j]);
            let inside = to >= lower.min(from) - LIMIT_SLACK && to <= upper.max(from) + LIMIT_SLACK;
            if !inside {
                return Err(Fault::SoftLimit);
            }
        }
        Ok(())
    }
}
