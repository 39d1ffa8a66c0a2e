//! A steady grid on `CLOCK_MONOTONIC`.

use nullsweep_ipc_types::ports::now_ns;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec};

/// Deadlines at a steady distance. What is missed is skipped, never caught up.
#[derive(Clone, Debug)]
pub struct Grid {
    period_ns: u64,
    due_ns: u64,
}

/// A wake-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// When it should have been. \[ns\]
    pub due_ns: u64,
    /// When it was. \[ns\]
    pub now_ns: u64,
    /// Deadlines that passed meanwhile and are skipped.
    pub skipped: u64,
}

impl Grid {
    /// The first deadline is one period from now.
    #[must_use]
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns, due_ns: now_ns() }
    }

    /// Sleeps until the next deadline.
    pub fn wait(&mut self) -> Tick {
        self.due_ns += self.period_ns;
        let due_ns = self.due_ns;
        sleep_until(due_ns);
        let now_ns = now_ns();
        let skipped = now_ns.saturating_sub(due_ns) / self.period_ns;
        self.due_ns += skipped * self.period_ns;
        Tick { due_ns, now_ns, skipped }
    }
}

/// Sleeps until a moment on `CLOCK_MONOTONIC`.
pub fn sleep_until(due_ns: u64) {
    let due = Timespec {
        tv_sec: (due_ns / 1_000_000_000) as i64,
        tv_nsec: (due_ns % 1_000_000_000) as i64,
    };
    // A signal that interrupts the sleep is noticed by whoever waits for it.
    let _ = clock_nanosleep_absolute(ClockId::Monotonic, &due);
}

#[cfg(test)]
mod tests {
    use std::thread;
    use std::time::Duration;

    use super::*;

    #[test]
    fn missed_deadlines_are_skipped_on_the_same_grid() {
        let mut grid = Grid::new(1_000_000);
        let first = grid.wait();
        assert!(first.now_ns >= first.due_ns);
        thread::sleep(Duration::from_millis(7));
        let late = grid.wait();
        assert!(late.skipped >= 5, "{late:?}");
        let next = grid.wait();
        assert_eq!((next.due_ns - first.due_ns) % 1_000_000, 0);
        assert_eq!(next.due_ns, late.due_ns + (late.skipped + 1) * 1_000_000);
    }
}
