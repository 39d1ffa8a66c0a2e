//! What the robot's clock shows, seen from here.

use std::collections::VecDeque;

use crate::wire::Reading;

/// Readings that are remembered: one a second, so clocks that go apart by 50 µs a second are told
/// apart by no more than 3 ms.
const REMEMBERED: usize = 64;
/// By how much clocks go apart while a reading is remembered. \[ns\]
const APART_NS: u64 = 3_000_000;

/// How much the robot's `CLOCK_MONOTONIC` is ahead of this one: from the reading that was back soonest.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// Each with its time under way. \[ns\]
    readings: VecDeque<(u64, i64)>,
}

impl Clock {
    /// Takes in an answered reading that came back at `now_ns`.
    pub fn take(&mut self, reading: Reading, now_ns: u64) {
        let under_way = now_ns.saturating_sub(reading.asked_ns);
        let middle = reading.asked_ns + under_way / 2;
        if self.readings.len() >= REMEMBERED {
            self.readings.pop_front();
        }
        self.readings.push_back((under_way, reading.answered_ns.wrapping_sub(middle) as i64));
    }

    /// Forgets all: the robot's end is another one, of another host perhaps.
    pub fn forget(&mut self) {
        self.readings.clear();
    }

    /// The robot's clock over this one's, and by how much that can be wrong. \[ns\]
    pub fn ahead(&self) -> Option<(i64, u64)> {
        let best = self.readings.iter().min_by_key(|(under_way, _)| *under_way)?;
        Some((best.1, best.0 / 2))
    }

    /// A moment of this clock, in the robot's time.
    pub fn there(&self, here_ns: u64) -> Option<u64> {
        Some(here_ns.saturating_add_signed(self.ahead()?.0))
    }

    /// The same, as early as it can have been: an executor refuses a plan that is from the future.
    pub fn earliest_there(&self, here_ns: u64) -> Option<u64> {
        let (_, error) = self.ahead()?;
        Some(self.there(here_ns)?.saturating_sub(error + APART_NS))
    }

    /// A moment of the robot's clock, in this one's.
    pub fn here(&self, there_ns: u64) -> Option<u64> {
        Some(there_ns.saturating_add_signed(self.ahead()?.0.checked_neg()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_soonest_answer_says_how_far_the_clocks_are_apart() {
        let mut clock = Clock::default();
        assert_eq!(clock.there(5), None);
        // The robot's clock is 1000 behind; 40 each way, then 400 there and 20 back.
        clock.take(Reading { asked_ns: 5000, answered_ns: 4040 }, 5080);
        clock.take(Reading { asked_ns: 6000, answered_ns: 5400 }, 6420);
        assert_eq!(clock.ahead(), Some((-1000, 40)));
        assert_eq!((clock.there(9000), clock.here(8000)), (Some(8000), Some(9000)));
        // What was published before it was asked at 5000 was so before it was answered at 4040.
        let late = 4_000_000_000;
        let earliest = clock.earliest_there(late + 5000).expect("there are readings");
        assert_eq!(earliest, late + 4000 - 40 - APART_NS);
        for i in 0..REMEMBERED as u64 {
            clock.take(Reading { asked_ns: i * 1000, answered_ns: i * 1000 + 150 }, i * 1000 + 100);
        }
        assert_eq!(clock.ahead(), Some((100, 50)), "what is old is forgotten");
        clock.forget();
        assert_eq!(clock.ahead(), None);
    }
}
