//! When each setpoint is followed: a buffer against jitter, as in audio over a network.
//!
//! Setpoints shall be followed a fixed delay after they are due. But an executor that misses
//! deadlines makes its plan late: the next setpoint is one cycle further on the path and several
//! cycles later in time. To follow it at that time would make the arm slow down and speed up at
//! once. The delay has room: the setpoint is followed a cycle after the one before it, and the
//! delay is won back by going a little slower for a while, with a bounded acceleration.

/// How soon the delay is won back. A slip of e seconds changes the pace by at most e / `SETTLE`²
/// each second: 20 ms at 1 rad/s are 2 rad/s². \[s\]
const SETTLE: f64 = 0.1;

/// The moments at which setpoints are followed.
#[derive(Clone, Debug)]
pub struct Playout {
    delay_ns: u64,
    /// Sequence of the last setpoint.
    sequence: u64,
    deadline_ns: u64,
    /// The executor's cycle: the least time between two deadlines so far. \[ns\]
    cycle_ns: u64,
    /// When the last setpoint is followed. \[ns\]
    at_ns: u64,
    /// How much longer than a cycle a cycle takes, as a share.
    stretch: f64,
}

impl Playout {
    /// Begins with this setpoint, `delay_ns` after its deadline.
    pub fn begin(delay_ns: u64, sequence: u64, deadline_ns: u64) -> Self {
        let at_ns = deadline_ns + delay_ns;
        Self { delay_ns, sequence, deadline_ns, cycle_ns: u64::MAX, at_ns, stretch: 0.0 }
    }

    /// When the last setpoint is followed. \[ns\]
    pub fn at_ns(&self) -> u64 {
        self.at_ns
    }

    /// How fast time goes there for the arm: a setpoint's velocity is multiplied by it.
    pub fn pace(&self) -> f64 {
        1.0 / (1.0 + self.stretch)
    }

    /// The next setpoint, of a higher sequence. `still`: the arm stands, so nothing shows if time
    /// leaps.
    pub fn advance(&mut self, sequence: u64, deadline_ns: u64, still: bool) {
        let cycles = sequence.saturating_sub(self.sequence).max(1);
        let apart_ns = deadline_ns.saturating_sub(self.deadline_ns);
        self.cycle_ns = self.cycle_ns.min(apart_ns / cycles);
        (self.sequence, self.deadline_ns) = (sequence, deadline_ns);
        let due_ns = deadline_ns + self.delay_ns;
        let step = (cycles * self.cycle_ns) as f64 * 1e-9;
        let ahead = (due_ns as f64 - self.at_ns as f64) * 1e-9 - step;
        if still {
            self.stretch = 0.0;
            self.at_ns = due_ns.max(self.at_ns + 1);
            return;
        }
        // Critically damped: the delay is won back without overshoot. Time never stands still.
        let change = ahead / (SETTLE * SETTLE) - 2.0 * self.stretch / SETTLE;
        self.stretch = (self.stretch + change * step).max(-0.5);
        self.at_ns += (step * (1.0 + self.stretch) * 1e9).round().max(1.0) as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const DELAY: u64 = 60 * MS;

    /// An executor that misses so many deadlines at once, again and again.
    fn slips(missed: u64, every: u64) -> Vec<(f64, f64, u64)> {
        let mut deadline = 1000 * MS;
        let mut playout = Playout::begin(DELAY, 1, deadline);
        let mut found = Vec::new();
        for sequence in 2..4000 {
            deadline += MS;
            if sequence % every == 0 && sequence < 3000 {
                deadline += missed * MS;
            }
            playout.advance(sequence, deadline, false);
            found.push((playout.at_ns() as f64 * 1e-9, playout.pace(), deadline + DELAY));
        }
        found
    }

    #[test]
    fn a_slip_is_spread_and_won_back() {
        for (missed, every, most) in [(1, 1000, 0.12), (20, 1000, 2.1), (1, 20, 0.6)] {
            let found = slips(missed, every);
            for pair in found.windows(2) {
                let rate = (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0);
                assert!(rate.abs() < most, "{missed} missed: pace changes by {rate} 1/s");
            }
            for &(at, _, due) in &found {
                let behind = due as f64 * 1e-9 - at;
                assert!((-1e-4..0.021).contains(&behind), "{missed} missed: {behind}");
            }
            let &(at, pace, due) = found.last().expect("one");
            assert!((at - due as f64 * 1e-9).abs() < 1e-5 && (pace - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn an_even_stream_and_a_reader_s_gap_change_nothing() {
        let mut playout = Playout::begin(DELAY, 1, 1000 * MS);
        for sequence in [2, 3, 50, 51] {
            playout.advance(sequence, (999 + sequence) * MS, false);
            assert_eq!(playout.at_ns(), (999 + sequence) * MS + DELAY);
            assert_eq!(playout.pace(), 1.0);
        }
        // At rest the delay is whole again at once.
        playout.advance(52, 2000 * MS, true);
        assert_eq!(playout.at_ns(), 2000 * MS + DELAY);
    }
}
