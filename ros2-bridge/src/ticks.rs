//! Moments a period apart, whenever it is looked.

/// When the next message of bare positions is due. A controller sets what comes when it comes, and its
/// drives take each position for a period after the last: so they are played a period apart, and not
/// when the loop happened to look.
#[derive(Clone, Copy, Debug)]
pub struct Ticks {
    period_ns: u64,
    next_ns: Option<u64>,
}

impl Ticks {
    /// A tick each `period_ns`, from the first look on. \[ns\]
    pub fn new(period_ns: u64) -> Self {
        Self { period_ns, next_ns: None }
    }

    /// The tick that is due, once. Of those that were missed altogether none is made up: the next one
    /// is now. \[ns\]
    pub fn due(&mut self, now_ns: u64) -> Option<u64> {
        let tick = self.next_ns.unwrap_or(now_ns);
        if now_ns < tick {
            return None;
        }
        let tick = if now_ns - tick > self.period_ns { now_ns } else { tick };
        self.next_ns = Some(tick + self.period_ns);
        Some(tick)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_a_period_apart_though_looks_are_not() {
        let mut ticks = Ticks::new(2_000);
        let looks = [10_000, 10_700, 11_900, 12_600, 13_800, 14_100, 16_500, 18_300];
        let found: Vec<_> = looks.iter().filter_map(|now| ticks.due(*now)).collect();
        assert_eq!(found, [10_000, 12_000, 14_000, 16_000, 18_000]);
        // A stall of four periods.
        assert_eq!(ticks.due(26_300), Some(26_300));
        assert_eq!(ticks.due(26_900), None);
        assert_eq!(ticks.due(28_400), Some(28_300));
    }
}
