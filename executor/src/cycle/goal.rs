//! The last knot is commanded: the plan is finished once the arm rests there.

use nullsweep_ipc_types::{EventKind, Fault, Mode, Reason};

use super::exchange::Output;
use super::state::{Arrival, State};
use crate::admit::Rejection;
use crate::guard::Guard;

impl State {
    /// Finishes the plan once the arm was measured at its end for long enough, or gives it up.
    pub(super) fn arrive(&mut self, now_ns: u64, guard: &Guard, out: &mut Output) {
        if self.stop.is_some() || self.mode == Mode::Fault {
            self.come_to_rest(guard, out);
            return;
        }
        let measured_ns = self.watch.fresh_ns;
        let off = match self.watch.measured() {
            Some(m) => guard.farthest(&self.q, &m.q, guard.goal_tolerance),
            None => Some((0, f64::NAN)),
        };
        let fresh = Arrival { since_ns: now_ns, near_ns: None };
        let arrival = self.arrival.get_or_insert(fresh);
        arrival.near_ns = match off {
            None => Some(arrival.near_ns.unwrap_or(measured_ns)),
            Some(_) => None,
        };
        let settled =
            arrival.near_ns.is_some_and(|n| measured_ns.saturating_sub(n) >= guard.settle_ns);
        let waited_ns = now_ns.saturating_sub(arrival.since_ns);
        if settled {
            self.finish(guard, out);
        } else if waited_ns >= guard.goal_ns {
            self.give_up(off, guard, out);
        }
    }

    /// The arm did not come to rest: the plan is aborted, and what was to start at its end.
    fn give_up(&mut self, off: Option<(usize, f64)>, guard: &Guard, out: &mut Output) {
        if let Some(path) = self.path.as_ref().filter(|_| self.live) {
            let mut why = Rejection::new(Reason::Goal).knot(path.knot().saturating_add(1));
            if let Some((joint, apart)) = off {
                why = why.joint(joint).value(apart, guard.goal_tolerance);
            }
            out.tell(path.plan().id(), EventKind::Aborted, why);
        }
        self.drop_path(out);
        self.end_waiting(EventKind::Aborted, Reason::Goal, out);
        self.mode = Mode::Hold;
        self.fault = Fault::FollowingError;
        self.paused = false;
    }
}
