//! What supervision remembers of the endpoint and of the loop's own rate.

use nullsweep_ipc_types::{Fault, status};

use super::exchange::{Measured, Refused};
use crate::JointVector;
use crate::guard::Guard;

/// Windows whose mean rate is judged, and the length of each. \[ns\]
const RATE_WINDOWS: usize = 3;
const RATE_WINDOW_NS: u64 = 200_000_000;
/// A stamp this far ahead of the cycle's own time is another clock's: a loop that was kept from
/// running between its wake-up and its read finds stamps that are a little ahead. \[ns\]
const AHEAD_NS: u64 = 5_000_000;
/// A new state this far behind is another clock's too. \[ns\]
const BEHIND_NS: u64 = 1_000_000_000;

/// What supervision remembers.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch {
    pub(super) newest: Option<Measured>,
    pub(super) fresh_ns: u64,
    pub(super) following: u32,
    pub(super) unheard: u32,
    /// The newest setpoint that a state has named and that can have been in force.
    pub(super) answered: u64,
    pub(super) refused: Refused,
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

    /// Takes a state in: whether it is a new one, or what is wrong with it. A stamp that does not
    /// rise is no new state, and one of another clock must not keep later good ones out. Of a
    /// continuous joint's whole turns those are taken that bring it nearest to `near`: an endpoint
    /// may wrap its angles.
    pub(super) fn take(
        &mut self,
        measured: Measured,
        near: Option<&JointVector>,
        now_ns: u64,
        guard: &Guard,
    ) -> Result<bool, Fault> {
        let stamp_ns = measured.stamp_ns;
        if self.newest.is_some_and(|n| stamp_ns <= n.stamp_ns) {
            return Ok(false);
        }
        if stamp_ns.saturating_sub(now_ns) > AHEAD_NS || now_ns.saturating_sub(stamp_ns) > BEHIND_NS
        {
            self.refused = Refused {
                count: self.refused.count.saturating_add(1),
                at_ns: now_ns,
                ahead_ns: ahead(stamp_ns, now_ns),
            };
            return Ok(false);
        }
        self.refused.at_ns = 0;
        if measured.joint_count != guard.dof {
            return Err(Fault::JointCount);
        }
        let mut own = measured;
        own.q.iter_mut().skip(guard.dof).for_each(|q| *q = 0.0);
        if let Some(near) = near {
            own.q = guard.continuous().nearest_turn(&own.q, near);
        }
        if !own.q.iter().all(|q| q.is_finite()) {
            return Err(Fault::NotFinite);
        }
        self.newest = Some(own);
        // A stamp from the future must not make a dead endpoint look alive.
        self.fresh_ns = stamp_ns.min(now_ns);
        Ok(true)
    }

    /// Whether what comes is refused for its stamps.
    pub(super) fn is_refusing(&self, now_ns: u64, guard: &Guard) -> bool {
        let Refused { at_ns, .. } = self.refused;
        at_ns > 0 && now_ns.saturating_sub(at_ns) < guard.lost_ns
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

    /// Whether the endpoint follows no setpoint now, as it says itself: it is not able to, or it
    /// has stopped by itself.
    pub(super) fn is_limp(&self) -> bool {
        let stopped = |m: Measured| m.status & status::SETPOINT_TIMEOUT != 0;
        self.endpoint().is_some() || self.newest.is_some_and(stopped)
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

/// How far a stamp is ahead of a time. \[ns\]
fn ahead(stamp_ns: u64, now_ns: u64) -> i64 {
    let apart = i64::try_from(stamp_ns.abs_diff(now_ns)).unwrap_or(i64::MAX);
    if stamp_ns > now_ns { apart } else { -apart }
}
