//! Is the endpoint there, sound, and following?

use nullsweep_ipc_types::{EventKind, Fault, Mode, Reason, status};

use super::exchange::{HELD_MOVED, Measured, Output};
use super::state::{REMEMBERED, State, StopCause};
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
        let bad = measured.and_then(|m| self.watch.take(m, now_ns, guard));
        let low_rate = self.watch.rate_is_low(now_ns, guard);
        match self.mode {
            Mode::Init => self.initialise(bad, now_ns, guard),
            Mode::Fault => self.follow_if_limp(guard, out),
            Mode::Hold | Mode::Executing | Mode::Paused | Mode::Stopping => {
                let age = self.watch.age(now_ns);
                let fault = bad
                    .map(|fault| (fault, Reaction::Brake))
                    .or_else(|| self.watch.endpoint().filter(|_| !self.is_off()))
                    .or_else(|| self.unheard(measured.as_ref(), guard))
                    .or_else(|| self.strays(measured.as_ref(), guard))
                    .or((age >= guard.lost_ns)
                        .then_some((Fault::CommunicationLost, Reaction::Brake)))
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
                self.follow_if_limp(guard, out);
            }
        }
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

    /// Waits for a sound endpoint; meanwhile commands where the arm is, so that nothing jumps.
    fn initialise(&mut self, bad: Option<Fault>, now_ns: u64, guard: &Guard) {
        let Some(measured) = self.watch.newest else {
            self.fault = bad.unwrap_or(Fault::None);
            return;
        };
        if self.has_position {
            self.creep(&measured.q, guard);
        } else {
            self.q = measured.q;
            self.has_position = true;
        }
        let stale = self.watch.age(now_ns) >= guard.stale_ns;
        let trouble = bad
            .or(self.watch.endpoint().map(|(fault, _)| fault))
            .or(stale.then_some(Fault::StaleState));
        self.fault = trouble.unwrap_or(Fault::None);
        let near =
            (0..guard.used().len()).all(|j| (self.q[j] - measured.q[j]).abs() <= HELD_WITHIN);
        if trouble.is_none() && near {
            self.mode = Mode::Hold;
            self.forget();
        }
    }

    /// Brings the command to where an arm is that does not follow it, so that it can begin to.
    fn follow_if_limp(&mut self, guard: &Guard, out: &mut Output) {
        let limp = match self.mode {
            // A fault stays latched when its cause is gone: with the motors on again the command
            // must stand, or a loaded arm sinks after its own sag.
            Mode::Fault => self.watch.is_limp(),
            _ => self.is_off(),
        };
        if limp && let Some(measured) = self.watch.newest {
            // Nothing brakes on the path any more.
            self.drop_path(out);
            self.creep(&measured.q, guard);
        }
    }

    /// Moves the commanded position towards a measured one, no faster than each joint may.
    fn creep(&mut self, to: &JointVector, guard: &Guard) {
        for (j, bound) in guard.used().iter().enumerate() {
            self.q[j] += limited(to[j] - self.q[j], bound.velocity() * guard.period());
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
    fn unheard(&mut self, measured: Option<&Measured>, guard: &Guard) -> Option<(Fault, Reaction)> {
        if let Some(m) = measured {
            let timeout = m.status & status::SETPOINT_TIMEOUT != 0 && !self.is_off();
            self.watch.unheard = if timeout { self.watch.unheard.saturating_add(1) } else { 0 };
        }
        (self.watch.unheard >= guard.debounce).then_some((Fault::Endpoint, Reaction::Follow))
    }

    /// The arm does not follow. Measured positions are compared with the setpoint that was in
    /// force then, so a known delay is no error.
    fn strays(&mut self, measured: Option<&Measured>, guard: &Guard) -> Option<(Fault, Reaction)> {
        let behind = self.sequence.checked_sub(measured?.setpoint_sequence)?;
        let heard = measured?.setpoint_sequence > 0;
        if !heard || behind >= REMEMBERED as u64 || self.is_off() {
            return None;
        }
        let newest = self.watch.newest?;
        let slot = (newest.setpoint_sequence % REMEMBERED as u64) as usize;
        let far = (0..guard.used().len()).any(|j| {
            let speed = self.remembered_v[slot][j].abs();
            let error = (self.remembered[slot][j] - newest.q[j]).abs();
            !(error <= guard.following_error + guard.following_lag * speed)
        });
        self.watch.following = if far { self.watch.following.saturating_add(1) } else { 0 };
        (self.watch.following >= guard.debounce).then_some((Fault::FollowingError, Reaction::Brake))
    }
}
