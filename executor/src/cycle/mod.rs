//! The loop's logic, one cycle at a time.
//!
//! [`step`] is a function of its arguments alone: no clock, no input or output, no heap, no
//! lock, and total over every state and event. So a recorded run replays bit for bit, and a
//! virtual clock runs millions of cycles in seconds.
//!
//! | mode | leaves it by |
//! |---|---|
//! | Init | a fresh, finite state of a calibrated, running endpoint that answers the setpoints, and commanded = measured → Hold |
//! | Hold | an accepted plan → Executing |
//! | Executing | last knot, and the arm measured there → Hold or the next plan; pause → Paused; stop, stale state, moved held joint → Stopping |
//! | Paused | resume → Executing; stop → Stopping |
//! | Stopping | stand-still → Hold, or Executing the plan that was waited for |
//! | Fault | reset (or resume after a halt), once the cause is gone → Init |
//!
//! Any mode but Init goes to Fault. The commanded position is always continued from the last
//! commanded one.

mod answer;
mod checkpoint;
mod command;
mod exchange;
mod goal;
mod motion;
mod offer;
mod state;
mod supervise;
mod watch;

use crate::guard::Guard;
use state::REMEMBERED;

pub use checkpoint::Checkpoint;
pub use exchange::{
    Ask, EVENTS, Event, HELD_MOVED, Input, Measured, Order, Output, Refused, Reply, Snapshot,
    Target,
};
pub use state::{State, WAITING};

/// One cycle. `now_ns` is the time of the wake-up on the clock of the states' stamps.
pub fn step(state: &mut State, input: Input, now_ns: u64, guard: &Guard) -> Output {
    let mut out = Output::default();
    state.cycle = state.cycle.wrapping_add(1);
    state.missed = state.missed.saturating_add(u64::from(input.missed));
    state.supervise(input.measured, now_ns, guard, &mut out);
    if let Some(ask) = input.ask {
        state.obey(ask, now_ns, guard, &mut out);
    }
    if let Some(plan) = input.offer {
        state.consider(plan, now_ns, guard, &mut out);
    }
    state.advance(now_ns, guard, &mut out);
    state.emit(&mut out);
    out
}

impl State {
    /// Makes the setpoint of this cycle and remembers it.
    fn emit(&mut self, out: &mut Output) {
        if !self.has_position {
            return;
        }
        self.sequence = self.sequence.wrapping_add(1);
        let slot = (self.sequence % REMEMBERED as u64) as usize;
        self.remembered[slot] = self.q;
        self.remembered_v[slot] = self.v;
        let snapshot = self.snapshot();
        out.setpoint = Some(Target {
            sequence: self.sequence,
            q: self.q,
            v: self.v,
            plan: snapshot.plan,
            knot: snapshot.knot,
            mode: self.mode,
            disable: self.is_off(),
        });
    }
}

#[cfg(test)]
mod tests;
