//! Is the endpoint there, sound, and following?

use nullsweep_ipc_types::{EventKind, Fault, Mode, Reason, status};

use super::exchange::{HELD_MOVED, Measured, Output};
use super::state::{State, StopCause};
use super::watch::Reaction;
use crate::JointVector;
use crate::guard::Guard;
use crate::total::limited;

/// How near commanded and measured positions must be for the arm to count as held. \[rad\]
const HELD_WITHIN: f64 = 0.01;

impl State {
    /// Takes the newest state in and reacts to what is wrong.
    pub(super) fn supervise(
        &mut self,
        measured: Option<Measured>,
        now_ns: u64,
        guard: &Guard,
        out: &mut Output,
    ) {
        let near = self.has_position.then_some(&self.q);
        let taken = measured.map_or(Ok(false), |m| self.watch.take(m, near, now_ns, guard));
        let bad = taken.err();
        let fresh = self.watch.newest.filter(|_| taken == Ok(true));
        self.note_answer(fresh.as_ref());
        let low_rate = self.watch.rate_is_low(now_ns, guard);
        match self.mode {
            Mode::Init => self.initialise(bad, now_ns, guard),
            Mode::Fault => self.follow_if_limp(now_ns, guard, out),
            Mode::Hold | Mode::Executing | Mode::Paused | Mode::Stopping => {
                let age = self.watch.age(now_ns);
                let fault = bad
                    .map(|fault| (fault, Reaction::Brake))
                    .or_else(|| self.watch.endpoint().filter(|_| !self.is_off()))
                    .or_else(|| self.unheard(fresh.as_ref(), guard))
                    .or_else(|| self.strays(fresh.as_ref(), guard))
                    .or_else(|| self.unanswering(fresh.as_ref(), now_ns, guard))
                    .or((age >= guard.lost_ns)
                        .then_some((self.silence(now_ns, guard), Reaction::Brake)))
                    .or(low_rate.then_some((Fault::LowRate, Reaction::Brake)));
                if let Some((fault, reaction)) = fault {
                    self.fail(fault, reaction, out);
                } else if age >= guard.stale_ns && self.path.is_some() {
                    self.lapse(Fault::StaleState, Reason::Fault, out);
                } else if measured.is_some_and(|m| m.status & HELD_MOVED != 0)
                    && self.path.is_some()
                {
                    self.lapse(Fault::HeldJoint, Reason::HeldJoint, out);
                }
                self.follow_if_limp(now_ns, guard, out);
            }
        }
    }

    /// What it is when no usable state comes.
    fn silence(&self, now_ns: u64, guard: &Guard) -> Fault {
        let refusing = self.watch.is_refusing(now_ns, guard);
        if refusing { Fault::Clock } else { Fault::CommunicationLost }
    }

    /// Latches a fault: every plan ends now, the arm slows down on its path or is followed.
    fn fail(&mut self, fault: Fault, reaction: Reaction, out: &mut Output) {
        self.end_all(EventKind::Aborted, Reason::Fault, out);
        self.mode = Mode::Fault;
        self.fault = fault;
        self.stop = None;
        self.paused = false;
        if reaction == Reaction::Follow {
            self.drop_path(out);
        }
    }

    /// Latches a fault of the setpoint itself: the arm holds the last good one.
    pub(super) fn freeze(&mut self, fault: Fault, out: &mut Output) {
        self.fail(fault, Reaction::Follow, out);
    }

    /// Whether the endpoint only does what it was asked to: its motors are off. A reset switches them
    /// on again, and the endpoint is waited for in Init.
    fn is_asked_for(&self, fault: Fault) -> bool {
        fault == Fault::Halted && self.is_off()
    }

    /// Whether the cause of the latched fault is gone.
    pub(super) fn is_cleared(&self, now_ns: u64, guard: &Guard) -> bool {
        self.path.is_none()
            && self.watch.age(now_ns) < guard.stale_ns
            && self.watch.endpoint().is_none_or(|(fault, _)| self.is_asked_for(fault))
    }

    /// Forgets what was counted before a fault.
    pub(super) fn forget(&mut self) {
        self.watch.following = 0;
        self.watch.unheard = 0;
        self.watch.windows = 0;
        self.watch.window_start_ns = 0;
        self.watch.window_cycles = 0;
    }

    /// Waits for a sound endpoint that answers; meanwhile commands where the arm is, so that
    /// nothing jumps. An endpoint may follow before its answer is here: once near enough to begin,
    /// the command stands, or a loaded arm sinks after its own sag.
    fn initialise(&mut self, bad: Option<Fault>, now_ns: u64, guard: &Guard) {
        let clock = self.watch.is_refusing(now_ns, guard).then_some(Fault::Clock);
        let Some(measured) = self.watch.newest else {
            self.fault = bad.or(clock).unwrap_or(Fault::None);
            return;
        };
        if self.has_position {
            let near = if self.is_off() { 0.0 } else { HELD_WITHIN };
            self.creep(&measured.q, near, guard);
        } else {
            self.q = measured.q;
            self.has_position = true;
        }
        let stale = self.watch.age(now_ns) >= guard.stale_ns;
        let unanswered = !self.is_off() && self.is_unanswered(now_ns, guard);
        let trouble = bad
            .or(self.watch.endpoint().map(|(fault, _)| fault))
            .or(clock)
            .or(stale.then_some(Fault::StaleState))
            .or(unanswered.then_some(Fault::Answer));
        self.fault = trouble.unwrap_or(Fault::None);
        let near =
            (0..guard.used().len()).all(|j| (self.q[j] - measured.q[j]).abs() <= HELD_WITHIN);
        let answers = self.watch.answered > 0 || self.is_off();
        if trouble.is_none() && near && answers {
            self.mode = Mode::Hold;
            self.forget();
        }
    }

    /// Brings the command to where an arm is that does not follow it, so that it can begin to.
    fn follow_if_limp(&mut self, now_ns: u64, guard: &Guard, out: &mut Output) {
        let Some(measured) = self.watch.newest else { return };
        let limp = match self.mode {
            // A fault stays latched when its cause is gone: with the motors on again the command
            // must stand, or a loaded arm sinks after its own sag.
            Mode::Fault => self.watch.is_limp(),
            _ => self.is_off(),
        };
        if limp {
            // Nothing brakes on the path any more.
            self.drop_path(out);
            self.creep(&measured.q, 0.0, guard);
        } else if self.mode == Mode::Fault && self.path.is_none() {
            let idle = measured.setpoint_sequence == 0 || self.is_unanswered(now_ns, guard);
            if idle {
                // It may follow all the same: near enough to begin, and no load sinks after its sag.
                self.creep(&measured.q, HELD_WITHIN, guard);
            }
        }
    }

    /// Moves the commanded position towards a measured one, no faster than each joint may, as far
    /// as a joint is not within `near` of it.
    fn creep(&mut self, to: &JointVector, near: f64, guard: &Guard) {
        for (j, bound) in guard.used().iter().enumerate() {
            let apart = to[j] - self.q[j];
            if !(apart.abs() <= near) {
                self.q[j] += limited(apart, bound.velocity() * guard.period());
            }
        }
        self.v = JointVector::ZERO;
    }

    /// What the motion relies on is gone: it stops on its path, and nothing is latched.
    fn lapse(&mut self, fault: Fault, why: Reason, out: &mut Output) {
        match self.stop {
            Some(StopCause::Replace) | None => {
                self.end_waiting(EventKind::Aborted, why, out);
                self.stop = Some(StopCause::Lapse(why));
                self.mode = Mode::Stopping;
                self.fault = fault;
            }
            Some(StopCause::Operator | StopCause::Lapse(_) | StopCause::Shutdown) => {}
        }
    }

    /// The endpoint hears no setpoints although they flow.
    fn unheard(&mut self, fresh: Option<&Measured>, guard: &Guard) -> Option<(Fault, Reaction)> {
        if let Some(m) = fresh {
            let timeout = m.status & status::SETPOINT_TIMEOUT != 0 && !self.is_off();
            self.watch.unheard = if timeout { self.watch.unheard.saturating_add(1) } else { 0 };
        }
        (self.watch.unheard >= guard.debounce).then_some((Fault::Endpoint, Reaction::Follow))
    }
}
