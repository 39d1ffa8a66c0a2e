//! The search's own copy of the costs: integers in blocks of cluster pairs, and candidate lists.
//!
//! Costs become i32 (exactly so where they are small integers), so that sums are exact whatever
//! their order. Jumps get a search price that is high against every arc but
//! no higher, so that a huge h neither overflows nor freezes the search; what a tour really costs
//! is always taken from the instance.

use crate::instance::{Ends, Instance, Jump};
use crate::pairs::{Pair, Pairs};
use crate::quantiser::Quantiser;
use crate::rooted::Rooted;

/// Length of a candidate list.
const NEAR: usize = 10;
/// Instances of fewer clusters, the root's included, are enumerated.
const SMALL: usize = 9;
/// Costs that are handled side by side; blocks may be read this far past their end.
pub(super) const LANES: usize = 8;

/// Costs for the search over `m` clusters, one of which, the root, always stands at position 0.
pub(super) struct Table {
    pub(super) m: usize,
    pub(super) root: usize,
    pub(super) sizes: Vec<u32>,
    /// Reversing a stretch without the root leaves the costs inside it as they are.
    pub(super) reversible: bool,
    /// Mean over the clusters of the cheapest arc out of them: the scale of the temperature.
    pub(super) typical: f64,
    /// No arc costs less, nor does a jump.
    pub(super) least: i32,
    pairs: Pairs,
    data: Vec<i32>,
    /// The cheapest entry of each row of each block.
    row_lowest: Vec<i32>,
    near: Near,
    /// The root is the fixed start outside the clusters.
    pub(super) outer_root: bool,
    /// No arc leads to the root but the closing one, which is free.
    open: bool,
    /// The instance's nodes that this table's stand for, where it has not all of them.
    names: Option<Vec<Vec<u32>>>,
}

/// The clusters that are cheap to reach from each one, and those from which it is, nearest first,
/// with the cheapest arc.
#[derive(Default)]
struct Near {
    out: Vec<(u32, i32)>,
    into: Vec<(u32, i32)>,
    /// Where each cluster's begin.
    starts: Vec<(u32, u32)>,
}

impl Table {
    /// The costs of an instance; `None` where 32 bits do not count them.
    pub(super) fn new(instance: &Instance) -> Option<Self> {
        let rooted = Rooted::new(instance)?;
        let (root, m) = (rooted.root, rooted.m);
        let sizes: Vec<u32> = (0..m).map(|a| rooted.size(a) as u32).collect();
        let mut blocks = Blocks::of(&rooted);
        let reversible = blocks.reversible(&rooted);
        blocks.transpose(&rooted, reversible);
        let Blocks { pairs, mut data, least } = blocks;
        data.extend_from_slice(&[0; LANES]);
        let mut table = Self {
            m,
            root,
            sizes,
            reversible,
            typical: 1.0,
            least,
            pairs,
            data,
            outer_root: root >= instance.clusters(),
            open: *instance.ends() != Ends::Closed,
            names: None,
            // Filled in below.
            row_lowest: Vec::new(),
            near: Near::default(),
        };
        table.find_row_lowest();
        table.find_candidates();
        Some(table)
    }

    /// The same costs between fewer nodes: `nodes` of each cluster, ascending.
    pub(super) fn restricted(&self, nodes: &[Vec<u32>]) -> Self {
        let m = self.m;
        let sizes: Vec<u32> = nodes.iter().map(|n| n.len() as u32).collect();
        let widest = sizes.iter().copied().max().unwrap_or(1) as usize;
        let mut data = vec![0; widest * widest];
        let mut pairs = self.pairs.clone();
        let stored = || (0..m as u32).flat_map(|a| self.pairs.row(a as usize).map(move |b| (a, b)));
        let stored = || stored().filter(|&(a, b)| self.is_stored(a, b));
        for (a, b) in stored() {
            let at = data.len();
            for &i in &nodes[a as usize] {
                let (_, row) = self.row(a, i, b);
                data.extend(nodes[b as usize].iter().map(|&j| row[j as usize]));
            }
            let lowest = data[at..].iter().copied().min().unwrap_or(0);
            pairs.set(a, b, Pair { at: at as u32, lowest, ..self.pairs.get(a, b) });
        }
        for (a, b) in stored() {
            let transposed = if self.pairs.get(a, b).transposed == self.pairs.get(b, a).at {
                pairs.get(b, a).at
            } else {
                let at = data.len();
                for &j in &nodes[b as usize] {
                    let (_, column) = self.column(a, b, j);
                    data.extend(nodes[a as usize].iter().map(|&i| column[i as usize]));
                }
                at as u32
            };
            pairs.set(a, b, Pair { transposed, ..pairs.get(a, b) });
        }
        data.extend_from_slice(&[0; LANES]);
        let mut table = Self {
            m,
            root: self.root,
            sizes,
            reversible: self.reversible,
            typical: self.typical,
            least: self.least,
            pairs,
            data,
            outer_root: self.outer_root,
            open: self.open,
            names: Some(nodes.to_vec()),
            // Filled in below.
            row_lowest: Vec::new(),
            near: Near::default(),
        };
        table.find_row_lowest();
        table.find_candidates();
        table
    }

    /// Whether there are so few clusters that their orders are enumerated.
    #[inline]
    pub(super) fn is_small(&self) -> bool {
        self.m < SMALL
    }

    /// Whether the costs between all clusters are known, not those between near ones alone.
    pub(super) fn has_all_pairs(&self) -> bool {
        matches!(self.pairs, Pairs::All { .. })
    }

    /// Whether arcs from `a` to `b` are known one by one.
    pub(super) fn is_stored(&self, a: u32, b: u32) -> bool {
        self.pairs.get(a, b).at != 0
    }

    fn find_row_lowest(&mut self) {
        let widest = self.sizes.iter().copied().max().unwrap_or(1) as usize;
        // Pairs that are not stored share a block of zeros.
        let mut row_lowest = vec![0; widest];
        for a in 0..self.m as u32 {
            let row: Vec<u32> = self.pairs.row(a as usize).collect();
            for b in row {
                let pair = self.pairs.get(a, b);
                if pair.at != 0 {
                    let rows = row_lowest.len() as u32;
                    self.pairs.set(a, b, Pair { rows, ..pair });
                    let (_, block) = self.block(a, b);
                    let lows = block
                        .chunks_exact(self.sizes[b as usize] as usize)
                        .map(|row| row.iter().copied().min().unwrap_or(0));
                    row_lowest.extend(lows);
                }
            }
        }
        self.row_lowest = row_lowest;
    }

    fn find_candidates(&mut self) {
        let (open, root) = (self.open, self.root as u32);
        let mut typical = 0.0;
        let mut counted = 0;
        let mut near = Near::default();
        for a in 0..self.m as u32 {
            let nearest = |skip_root: bool, pair: &dyn Fn(u32) -> Pair| {
                let others = self.pairs.row(a as usize).filter(|&b| !(skip_root && b == root));
                let arcs = others.map(|b| (pair(b), b)).filter(|(pair, _)| pair.at != 0);
                let mut list: Vec<(i32, u32)> = arcs.map(|(pair, b)| (pair.lowest, b)).collect();
                list.sort_unstable();
                list.truncate(NEAR);
                list
            };
            let out = nearest(open, &|b| self.pairs.get(a, b));
            let into = nearest(false, &|b| self.pairs.get(b, a));
            if let Some(&(c, _)) = out.first() {
                typical += f64::from(c);
                counted += 1;
            }
            near.starts.push((near.out.len() as u32, near.into.len() as u32));
            near.out.extend(out.into_iter().map(|(c, b)| (b, c)));
            near.into.extend(into.into_iter().map(|(c, b)| (b, c)));
        }
        near.starts.push((near.out.len() as u32, near.into.len() as u32));
        self.near = near;
        self.typical = (typical / f64::from(counted.max(1))).max(1.0);
    }

    /// Cost from node `i` of `a` to node `j` of `b`.
    #[inline]
    pub(super) fn d(&self, a: u32, i: u32, b: u32, j: u32) -> i32 {
        let pair = self.pairs.get(a, b);
        pair.add + self.data[(pair.at + i * self.sizes[b as usize] + j) as usize]
    }

    /// Costs from node `i` of `a` to every node of `b`: what to add, and the row.
    #[inline]
    pub(super) fn row(&self, a: u32, i: u32, b: u32) -> (i32, &[i32]) {
        let pair = self.pairs.get(a, b);
        let width = self.sizes[b as usize];
        let at = (pair.at + i * width) as usize;
        (pair.add, &self.data[at..at + width as usize])
    }

    /// Costs from every node of `a` to node `j` of `b`.
    #[inline]
    pub(super) fn column(&self, a: u32, b: u32, j: u32) -> (i32, &[i32]) {
        let pair = self.pairs.get(a, b);
        let height = self.sizes[a as usize];
        let at = (pair.transposed + j * height) as usize;
        (pair.add, &self.data[at..at + height as usize])
    }

    /// The block from `a` to `b`, row-major.
    #[inline]
    pub(super) fn block(&self, a: u32, b: u32) -> (i32, &[i32]) {
        let pair = self.pairs.get(a, b);
        let count = (self.sizes[a as usize] * self.sizes[b as usize]) as usize;
        (pair.add, &self.data[pair.at as usize..pair.at as usize + count])
    }

    /// Cheapest arc from `a` to `b`.
    #[inline]
    pub(super) fn low(&self, a: u32, b: u32) -> i32 {
        self.pairs.get(a, b).lowest
    }

    /// The block from `a` to `b` with the data that follow it, at least `LANES` entries, and for each
    /// node of `a` the cheapest entry of its row.
    #[inline]
    pub(super) fn open_block(&self, a: u32, b: u32) -> (i32, &[i32], &[i32]) {
        let pair = self.pairs.get(a, b);
        let lows = &self.row_lowest[pair.rows as usize..];
        (pair.add, &self.data[pair.at as usize..], &lows[..self.sizes[a as usize] as usize])
    }

    /// For each node of `a` the cheapest entry of its row in [`Self::block`].
    #[inline]
    pub(super) fn row_lowest(&self, a: u32, b: u32) -> &[i32] {
        let at = self.pairs.get(a, b).rows as usize;
        &self.row_lowest[at..at + self.sizes[a as usize] as usize]
    }

    /// For each node of `b` the cheapest entry of its column in [`Self::block`].
    pub(super) fn column_lowest(&self, a: u32, b: u32) -> Vec<i32> {
        let (_, block) = self.block(a, b);
        let mut lowest = vec![i32::MAX; self.sizes[b as usize] as usize];
        for row in block.chunks_exact(lowest.len()) {
            for (low, d) in lowest.iter_mut().zip(row) {
                *low = (*low).min(*d);
            }
        }
        lowest
    }

    /// Clusters that are cheap to reach from `a`, nearest first, with the cheapest arc.
    #[inline]
    pub(super) fn near_out(&self, a: u32) -> impl Iterator<Item = (u32, i32)> + '_ {
        let starts = &self.near.starts[a as usize..];
        self.near.out[starts[0].0 as usize..starts[1].0 as usize].iter().copied()
    }

    /// Clusters from which `a` is cheap to reach, nearest first, with the cheapest arc.
    #[inline]
    pub(super) fn near_in(&self, a: u32) -> impl Iterator<Item = (u32, i32)> + '_ {
        let starts = &self.near.starts[a as usize..];
        self.near.into[starts[0].1 as usize..starts[1].1 as usize].iter().copied()
    }

    /// The instance's node that node `i` of cluster `c` stands for.
    #[inline]
    pub(super) fn instance_node(&self, c: u32, i: u32) -> u32 {
        self.names.as_ref().map_or(i, |names| names[c as usize][i as usize])
    }
}

/// The blocks of all cluster pairs.
struct Blocks {
    pairs: Pairs,
    data: Vec<i32>,
    least: i32,
}

impl Blocks {
    /// Row by row.
    fn of(rooted: &Rooted<'_>) -> Self {
        let widest = rooted.widest();
        let quantiser = Quantiser::new(rooted);
        let mut data = vec![0; widest * widest];
        let mut pairs = Pairs::new(rooted, &quantiser);
        let mut row = Vec::new();
        for (a, b) in rooted.pairs() {
            let mut pair = Pair::flat(quantiser.steps(rooted.price(a, b)));
            row.clear();
            let mut present = false;
            if rooted.maybe_adjacent(a, b) {
                for entry in rooted.entries(a, b) {
                    present |= entry.is_some();
                    row.push(entry.map_or(pair.add, |cost| quantiser.steps(cost)));
                }
            }
            if present {
                let lowest = row.iter().copied().min().unwrap_or(i32::MAX);
                pair = Pair { at: data.len() as u32, lowest, ..Pair::flat(0) };
                data.extend_from_slice(&row);
            }
            pairs.set(a as u32, b as u32, pair);
        }
        // Arcs that are not kept are dearer than some that are.
        let prices_below_zero = match rooted.instance.jump() {
            Jump::Forbidden => false,
            Jump::Uniform(price) => *price < 0.0,
            Jump::Table(prices) => prices.iter().any(|price| *price < 0.0),
        };
        let below_zero = prices_below_zero || data.iter().any(|cost| *cost < 0);
        let least = if below_zero { quantiser.steps(f64::NEG_INFINITY) } else { 0 };
        Self { pairs, data, least }
    }

    /// Whether the costs between all clusters but the root are symmetric.
    fn reversible(&self, rooted: &Rooted<'_>) -> bool {
        let root = rooted.root;
        rooted.pairs().all(|(a, b)| {
            a < b || a == root || b == root || {
                let (p, q) =
                    (self.pairs.get(a as u32, b as u32), self.pairs.get(b as u32, a as u32));
                let (x, y) = (rooted.size(a), rooted.size(b));
                p.add == q.add
                    && (0..x).all(|i| {
                        (0..y).all(|j| {
                            self.data[p.at as usize + i * y + j]
                                == self.data[q.at as usize + j * x + i]
                        })
                    })
            }
        })
    }

    /// Finds each block column by column: the opposite block where that is the same.
    fn transpose(&mut self, rooted: &Rooted<'_>, reversible: bool) {
        for (a, b) in rooted.pairs() {
            let pair = self.pairs.get(a as u32, b as u32);
            if pair.at == 0 {
                continue;
            }
            let transposed = if reversible && a != rooted.root && b != rooted.root {
                self.pairs.get(b as u32, a as u32).at
            } else {
                let (x, y) = (rooted.size(a), rooted.size(b));
                let start = self.data.len();
                for j in 0..y {
                    for i in 0..x {
                        let value = self.data[pair.at as usize + i * y + j];
                        self.data.push(value);
                    }
                }
                start as u32
            };
            self.pairs.set(a as u32, b as u32, Pair { transposed, ..pair });
        }
    }
}
