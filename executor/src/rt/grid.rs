//! Absolute deadlines on one grid: start + k · period.

use nullsweep_ipc_types::ports::now_ns;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec};

/// A grid of deadlines on `CLOCK_MONOTONIC`.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    next: u64,
    period: u64,
    spin: u64,
}

/// Time before a deadline that is not given away: longer than any rehearsal. \[ns\]
const RESERVE: u64 = 15_000;

/// One wake-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wake {
    /// The newest deadline that has passed. \[ns\]
    pub deadline_ns: u64,
    /// When the thread ran again. \[ns\]
    pub now_ns: u64,
    /// Deadlines before it that went by unattended.
    pub missed: u32,
}

impl Wake {
    /// How late it is. \[ns\]
    #[must_use]
    pub fn lateness_ns(&self) -> u64 {
        self.now_ns.saturating_sub(self.deadline_ns)
    }
}

impl Grid {
    /// A grid whose first deadline is one period from now. The last `spin_ns` before a deadline
    /// are spent spinning; on a single core, or for a whole period, that would starve the rest.
    #[must_use]
    pub fn start(period_ns: u64, spin_ns: u64) -> Self {
        let period = period_ns.max(1);
        Self { next: now_ns() + period, period, spin: spin_ns.min(period / 2) }
    }

    /// Sleeps, then spins, to the next deadline. Deadlines that have passed meanwhile are
    /// skipped, on the same grid: no cycle is ever made up for. In place of spinning, `early` is
    /// called with the deadline again and again, as long as there is time for it.
    #[inline]
    pub fn wait(&mut self, mut early: impl FnMut(u64)) -> Wake {
        let wake_at = self.next - self.spin;
        if now_ns() < wake_at {
            let at = Timespec {
                tv_sec: (wake_at / 1_000_000_000).cast_signed(),
                tv_nsec: (wake_at % 1_000_000_000).cast_signed(),
            };
            // A signal may wake it early; the loop below sees to the rest.
            while clock_nanosleep_absolute(ClockId::Monotonic, &at).is_err() {}
        }
        let mut now = now_ns();
        while now + RESERVE < self.next {
            early(self.next);
            now = now_ns();
        }
        while now < self.next {
            std::hint::spin_loop();
            now = now_ns();
        }
        self.passed(now)
    }

    fn passed(&mut self, now_ns: u64) -> Wake {
        let missed = (now_ns - self.next) / self.period;
        let deadline_ns = self.next + missed * self.period;
        self.next = deadline_ns + self.period;
        Wake { deadline_ns, now_ns, missed: u32::try_from(missed).unwrap_or(u32::MAX) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skipped_deadlines_stay_on_the_grid() {
        let mut grid = Grid { next: 1000, period: 100, spin: 0 };
        assert_eq!(grid.passed(1000), Wake { deadline_ns: 1000, now_ns: 1000, missed: 0 });
        assert_eq!(grid.passed(1199), Wake { deadline_ns: 1100, now_ns: 1199, missed: 0 });
        let late = grid.passed(1555);
        assert_eq!(late, Wake { deadline_ns: 1500, now_ns: 1555, missed: 3 });
        assert_eq!((late.lateness_ns(), grid.next), (55, 1600));
    }

    #[test]
    fn wakes_at_or_after_the_deadline() {
        let mut grid = Grid::start(1_000_000, 50_000);
        let first = grid.next;
        for _ in 0..20 {
            let wake = grid.wait(|deadline| assert_eq!((deadline - first) % 1_000_000, 0));
            assert!(wake.now_ns >= wake.deadline_ns);
            assert_eq!((wake.deadline_ns - first) % 1_000_000, 0);
        }
    }
}
