//! What supervision remembers of the endpoint and of the loop's own rate.

use nullsweep_ipc_types::{Fault, status};

use super::exchange::Measured;
use crate::guard::Guard;

/// Windows whose mean rate is judged, and the length of each. \[ns\]
const RATE_WINDOWS: usize = 3;
const RATE_WINDOW_NS: u64 = 200_000_000;

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
pub(super) enum Reaction {
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
    pub(super) fn take(&mut self, measured: Measured, now_ns: u64, guard: &Guard) -> Option<Fault> {
        if self.newest.is_some_and(|n| measured.stamp_ns <= n.stamp_ns) {
            return None;
        }
        if measured.joint_count != guard.dof {
            return Some(Fault::JointCount);
        }
        if !measured.q.iter().take(guard.dof).all(|q| q.is_finite()) {
            return Some(Fault::NotFinite);
        }
        let mut own = measured;
        own.q.iter_mut().skip(guard.dof).for_each(|q| *q = 0.0);
        self.newest = Some(own);
        // A stamp from the future must not make a dead endpoint look alive.
        self.fresh_ns = measured.stamp_ns.min(now_ns);
        None
    }

    /// What the endpoint says about itself.
    pub(super) fn endpoint(&self) -> Option<(Fault, Reaction)> {
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

    /// Whether the endpoint follows no setpoint now, as it says itself: it is not able to, it has
    /// stopped by itself, or it has begun anew and had none yet that is near enough.
    pub(super) fn is_limp(&self) -> bool {
        let idle =
            |m: Measured| m.status & status::SETPOINT_TIMEOUT != 0 || m.setpoint_sequence == 0;
        self.endpoint().is_some() || self.newest.is_some_and(idle)
    }

    /// Counts cycles in windows; whether the mean over all windows is too low.
    pub(super) fn rate_is_low(&mut self, now_ns: u64, guard: &Guard) -> bool {
        if self.window_start_ns == 0 {
            self.window_start_ns = now_ns;
            return false;
        }
        self.window_cycles = self.window_cycles.saturating_add(1);
        let elapsed = now_ns.saturating_sub(self.window_start_ns);
        if elapsed < RATE_WINDOW_NS {
            return false;
        }
        let slot = (self.windows % RATE_WINDOWS as u64) as usize;
        self.rates[slot] = f64::from(self.window_cycles) / (elapsed as f64 * 1e-9);
        self.windows = self.windows.wrapping_add(1);
        self.window_start_ns = now_ns;
        self.window_cycles = 0;
        let mean = self.rates.iter().sum::<f64>() / RATE_WINDOWS as f64;
        self.windows >= RATE_WINDOWS as u64 && !(mean >= guard.min_rate)
    }
}
