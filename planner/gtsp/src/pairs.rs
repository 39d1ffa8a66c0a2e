//! Where the costs from each cluster to each other one lie: for all pairs, or for near ones alone.

use std::sync::Arc;

use crate::instance::Instance;
use crate::quantiser::Quantiser;
use crate::rooted::Rooted;

/// Costs from one cluster to another in the table's data. Pairs without a block of their own share
/// one of zeros and add their price.
#[derive(Clone, Copy)]
pub(super) struct Pair {
    /// The block row by row; 0 where none is stored.
    pub(super) at: u32,
    /// The block column by column.
    pub(super) transposed: u32,
    /// The cheapest entry of each row.
    pub(super) rows: u32,
    /// What is added to each entry.
    pub(super) add: i32,
    /// The cheapest arc.
    pub(super) lowest: i32,
}

impl Pair {
    /// No block: every arc costs the same.
    pub(super) fn flat(price: i32) -> Self {
        Self { at: 0, transposed: 0, rows: 0, add: price, lowest: price }
    }
}

/// All ordered pairs of `m` clusters, or those of near ones by their hash and the others by an arc
/// between their first nodes, which is never far from what a good tour would not take anyway.
#[derive(Clone)]
pub(super) enum Pairs {
    /// Row-major m×m.
    All { m: usize, pairs: Vec<Pair> },
    /// See above.
    Near { rows: Arc<[Vec<u32>]>, slots: Vec<(u32, u32, Pair)>, far: Arc<Far> },
}

/// Costs between clusters that are not near each other.
pub(super) struct Far {
    instance: Instance,
    quantiser: Quantiser,
}

/// What no cluster is called: an empty slot.
const NONE: u32 = u32::MAX;

impl Pairs {
    /// Pairs without costs, as the search is to see them.
    pub(super) fn new(rooted: &Rooted<'_>, quantiser: &Quantiser) -> Self {
        let Some(rows) = rooted.kept() else {
            // The diagonal is in no list of candidates.
            let none = Pair { lowest: i32::MAX, ..Pair::flat(0) };
            return Self::All { m: rooted.m, pairs: vec![none; rooted.m * rooted.m] };
        };
        let count: usize = rows.iter().map(Vec::len).sum();
        let slots = vec![(NONE, NONE, Pair::flat(0)); (2 * count + 2).next_power_of_two()];
        let far = Far { instance: rooted.instance.clone(), quantiser: quantiser.clone() };
        Self::Near { rows: Arc::clone(rows), slots, far: Arc::new(far) }
    }

    /// Costs from `a` to `b`.
    #[inline]
    pub(super) fn get(&self, a: u32, b: u32) -> Pair {
        match self {
            Self::All { m, pairs } => pairs[a as usize * m + b as usize],
            Self::Near { slots, far, .. } => {
                let slot = &slots[find(slots, a, b)];
                if slot.0 == a { slot.2 } else { Pair::flat(far.cost(a, b)) }
            }
        }
    }

    /// Sets them for a pair that is seen.
    pub(super) fn set(&mut self, a: u32, b: u32, pair: Pair) {
        match self {
            Self::All { m, pairs } => pairs[a as usize * *m + b as usize] = pair,
            Self::Near { slots, .. } => {
                let k = find(slots, a, b);
                slots[k] = (a, b, pair);
            }
        }
    }

    /// The clusters that may have a block of costs from `a`, ascending.
    pub(super) fn row(&self, a: usize) -> impl Iterator<Item = u32> + '_ {
        let (all, near) = match self {
            Self::All { m, .. } => (0..*m as u32, [].as_slice()),
            Self::Near { rows, .. } => (0..0, rows[a].as_slice()),
        };
        all.filter(move |&b| b as usize != a).chain(near.iter().copied())
    }
}

/// The slot of a pair, or the empty one where it would go.
#[inline]
fn find(slots: &[(u32, u32, Pair)], a: u32, b: u32) -> usize {
    let key = u64::from(a) << 32 | u64::from(b);
    let shift = 64 - slots.len().trailing_zeros();
    let mut k = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> shift) as usize;
    while slots[k].0 != NONE && (slots[k].0, slots[k].1) != (a, b) {
        k = (k + 1) & (slots.len() - 1);
    }
    k
}

impl Far {
    /// Cost between the first nodes of two clusters, the same both ways.
    fn cost(&self, a: u32, b: u32) -> i32 {
        let (a, b) = (a.min(b) as usize, a.max(b) as usize);
        let arc = self.instance.arc(a, 0, b, 0);
        self.quantiser.steps(arc.unwrap_or_else(|| self.instance.jump_price(a, b)))
    }
}
