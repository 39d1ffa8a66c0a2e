//! Which setpoint does the endpoint follow, and is the arm where that one wants it?
//!
//! Measured is compared with commanded in every state that comes: where the state names a setpoint
//! that is remembered, with that one, so that a known delay is no error; else with the newest one
//! and a bound that grows with the time since the last good answer, at each joint's speed. An
//! endpoint that gives no good answer for as long as communication may be lost is at fault itself.

use nullsweep_ipc_types::{Fault, status};

use super::exchange::Measured;
use super::state::{REMEMBERED, State};
use super::watch::Reaction;
use crate::guard::Guard;

/// Cycles that an answer may be behind whatever the rate of the loop.
const LEAST_CYCLES: u64 = 10;

impl State {
    /// Notes which setpoint a new state says was in force. One that was never sent, or one from
    /// before the last one noted, is no answer.
    pub(super) fn note_answer(&mut self, fresh: Option<&Measured>) {
        let told = fresh.map_or(0, |m| m.setpoint_sequence);
        if told > 0 && told >= self.watch.answered && told <= self.sequence {
            self.watch.answered = told;
        }
    }

    /// Whether the last good answer is older than communication may be lost, counted in
    /// setpoints up to when the newest state was measured: how long that state was under way is
    /// judged by its stamp.
    pub(super) fn is_unanswered(&self, now_ns: u64, guard: &Guard) -> bool {
        let most_ns = guard.lost_ns.max(LEAST_CYCLES.saturating_mul(guard.period_ns));
        let behind_ns = self.behind().saturating_mul(guard.period_ns);
        behind_ns.saturating_sub(self.watch.age(now_ns)) >= most_ns
    }

    /// Setpoints since the last good answer.
    fn behind(&self) -> u64 {
        self.sequence.saturating_sub(self.watch.answered)
    }

    /// The endpoint sends states, but none that says what it follows.
    pub(super) fn unanswering(
        &self,
        fresh: Option<&Measured>,
        now_ns: u64,
        guard: &Guard,
    ) -> Option<(Fault, Reaction)> {
        let told = fresh?.status;
        if self.is_off() || !self.is_unanswered(now_ns, guard) {
            None
        } else if told & status::SETPOINT_TIMEOUT != 0 {
            Some((Fault::Endpoint, Reaction::Follow))
        } else {
            Some((Fault::Answer, Reaction::Brake))
        }
    }

    /// The arm does not follow.
    pub(super) fn strays(
        &mut self,
        fresh: Option<&Measured>,
        guard: &Guard,
    ) -> Option<(Fault, Reaction)> {
        let measured = fresh?;
        if self.is_off() {
            return None;
        }
        let told = measured.setpoint_sequence;
        let known = told > 0 && told == self.watch.answered && self.behind() < REMEMBERED as u64;
        let slot = (told % REMEMBERED as u64) as usize;
        let (q, v, seconds) = if known {
            (&self.remembered[slot], &self.remembered_v[slot], 0.0)
        } else {
            (&self.q, &self.v, self.behind() as f64 * guard.period())
        };
        let apart = guard.continuous().displacement(q, &measured.q);
        let far = guard.used().iter().enumerate().any(|(j, bound)| {
            let lag = guard.following_lag * v[j].abs() + bound.velocity() * seconds;
            !(apart[j] <= guard.following_error + lag)
        });
        self.watch.following = if far { self.watch.following.saturating_add(1) } else { 0 };
        (self.watch.following >= guard.debounce).then_some((Fault::FollowingError, Reaction::Brake))
    }
}
