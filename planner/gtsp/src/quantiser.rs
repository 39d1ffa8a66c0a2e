//! Costs to integers of 32 bits.

use crate::instance::Jump;
use crate::rooted::Rooted;

/// Jump price in the search, in units of the largest arc worth having.
const JUMP_FACTOR: f64 = 4.0;
/// Costs of at most this much count as zero.
const TINY: f64 = 1e-200;

/// Costs to integers, so that the sum of a whole tour fits 32 bits; the identity where the costs are
/// small integers.
#[derive(Clone)]
pub(super) struct Quantiser {
    ceiling: f64,
    scale: f64,
}

impl Quantiser {
    pub(super) fn new(rooted: &Rooted<'_>) -> Self {
        let (statistics, jump) = (&rooted.statistics, rooted.instance.jump());
        // Without any arc, or with free ones only, jumps alone set the scale.
        let cap = if statistics.largest > TINY { statistics.largest } else { 1.0 };
        // Prices of a table differ among themselves, which must not be lost.
        let highest_price = match jump {
            Jump::Table(table) => table.iter().copied().fold(0.0, f64::max),
            _ => 0.0,
        };
        let ceiling = highest_price.max(JUMP_FACTOR * cap);
        let room = f64::from(1 << 30) / (rooted.m + 2) as f64;
        let whole_prices = match (statistics.big_m, jump) {
            (Some(_), _) | (None, Jump::Forbidden) => true,
            (None, Jump::Uniform(h)) => h.fract() == 0.0,
            (None, Jump::Table(table)) => table.iter().all(|h| h.fract() == 0.0),
        };
        let exact = statistics.integers && whole_prices && ceiling <= room;
        Self { ceiling, scale: if exact { 1.0 } else { room / ceiling } }
    }

    /// The cost in the search.
    #[inline]
    pub(super) fn steps(&self, cost: f64) -> i32 {
        (cost.clamp(-self.ceiling, self.ceiling) * self.scale).round() as i32
    }
}
