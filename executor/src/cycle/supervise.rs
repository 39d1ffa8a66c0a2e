//! Is the endpoint there, sound, and following?

use nullsweep_ipc_types::{EventKind, Fault, Mode, Reason, status};

use super::{Output, REMEMBERED, State, StopCause};
use crate::JointVector;
use crate::guard::Guard;

/// Windows whose mean rate is judged, and the length of each. \[ns\]
const RATE_WINDOWS: usize = 3;
const RATE_WINDOW_NS: u64 = 200_000_000;
/// How near commanded and measured positions must be for the arm to count as held. \[rad\]
const HELD_WITHIN: f64 = 0.01;

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
    /// Bits of [`status`], and [`HELD_MOVED`].
    pub status: u32,
}

/// Set in [`Measured::status`] while a held joint is not where it was when the motion began. The
/// endpoint has no say in this bit.
pub const HELD_MOVED: u32 = 1 << 31;

/// What supervision remembers.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    pub(super) newest: Option<Measured>,
    pub(super) fresh_ns: u64,
    pub(super) following: u32,
    pub(super) unheard: u32,
    pub(super) window_start_ns: u64,
    pub(super) window_cycles: u32,
    pub(super) rates: [f64; RATE_WINDOWS],
    pub(super) windows: u64,
}

/// How a fault ends the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Reaction {
    /// Slow down on the path.
    Brake,
    /// The motors are off or not ours: follow where the arm goes, so that nothing jumps later.
    Follow,
}

impl Watch {
    pub(super) fn measured(&self) -> Option<&Measured> {
        self.newest.as_ref()
    }

    pub(super) fn age(&self, now_ns: u64) -> u64 {
        if self.newest.is_some() { now_ns.saturating_sub(self.fresh_ns) } else { u64::MAX }
    }

    /// Takes a state in; what is wrong with it. A stamp that does not rise is no new state.
    fn take(&mut self, measured: Measured, now_ns: u64, guard: &Guard) -> Option<Fault> {
        if self.newest.is_some_and(|n| measured.stamp_ns <= n.stamp_ns) {
            return None;
        }
        if measured.joint_count != guard.dof {
            return Some(Fault::JointCount);
        }
        if !measured.q[..guard.dof].iter().all(|q| q.is_finite()) {
            return Some(Fault::NotFinite);
        }
        let mut own = measured;
        own.q[guard.dof..].fill(0.0);
        self.newest = Some(own);
        // A stamp from the future must not make a dead endpoint look alive.
        self.fresh_ns = measured.stamp_ns.min(now_ns);
        None
    }

    /// What the endpoint says about itself.
    fn endpoint(&self) -> Option<(Fault, Reaction)> {
        let status = self.newest?.status;
        if status & status::ERROR != 0 {
            Some((Fault::Endpoint, Reaction::Follow))
        } else if status & status::HALTED != 0 {
            Some((Fault::Halted, Reaction::Follow))
        } else if status & status::CALIBRATED == 0 {
            Some((Fault::NotCalibrated, Reaction::Follow))
        } else {
            None
        }
    }

    /// Whether the endpoint follows no setpoint now, by its own word: it is not able to, it has
    /// stopped by itself, or it has begun anew and had none yet that is near enough.
    fn is_limp(&self) -> bool {
        let idle =
            |m: Measured| m.status & status::SETPOINT_TIMEOUT != 0 || m.setpoint_sequence == 0;
        self.endpoint().is_some() || self.newest.is_some_and(idle)
    }

    /// Counts cycles in windows; whether the mean over all windows is too low.
    fn rate_is_low(&mut self, now_ns: u64, guard: &Guard) -> bool {
        if self.window_start_ns == 0 {
            self.window_start_ns = now_ns;
            return false;
        }
        self.window_cycles += 1;
        let elapsed = now_ns.saturating_sub(self.window_start_ns);
        if elapsed < RATE_WINDOW_NS {
            return false;
        }
        let slot = (self.windows % RATE_WINDOWS as u64) as usize;
        self.rates[slot] = f64::from(self.window_cycles) / (elapsed as f64 * 1e-9);
        self.windows += 1;
        self.window_start_ns = now_ns;
        self.window_cycles = 0;
        let mean = self.rates.iter().sum::<f64>() / RATE_WINDOWS as f64;
        self.windows >= RATE_WINDOWS as u64 && mean < guard.min_rate
    }
}

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

    /// Whether the cause of the latched fault is gone.
    pub(super) fn is_cleared(&self, now_ns: u64, guard: &Guard) -> bool {
        self.path.is_none()
            && self.watch.age(now_ns) < guard.stale_ns
            && self.watch.endpoint().is_none()
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
        let near = (0..guard.dof).all(|j| (self.q[j] - measured.q[j]).abs() <= HELD_WITHIN);
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
            let step = bound.velocity() * guard.period();
            self.q[j] += (to[j] - self.q[j]).clamp(-step, step);
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
        let far = (0..guard.dof).any(|j| {
            let speed = self.remembered_v[slot][j].abs();
            let error = (self.remembered[slot][j] - newest.q[j]).abs();
            !(error <= guard.following_error + guard.following_lag * speed)
        });
        self.watch.following = if far { self.watch.following.saturating_add(1) } else { 0 };
        (self.watch.following >= guard.debounce).then_some((Fault::FollowingError, Reaction::Brake))
    }
}
