//! The search's own copy of the costs: integers in blocks of cluster pairs, and candidate lists.
//!
//! Costs become i32 (exactly so where they are small integers), so that sums are exact whatever
//! their order. Jumps get a search price that is high against every arc but
//! no higher, so that a huge h neither overflows nor freezes the search; what a tour really costs
//! is always taken from the instance.

use crate::instance::{Ends, Instance, Jump};
use crate::rooted::Rooted;

/// Jump price in the search, in units of the largest arc worth having.
const JUMP_FACTOR: f64 = 4.0;
/// Length of a candidate list.
const NEAR: usize = 10;
/// Instances of fewer clusters, the root's included, are enumerated.
const SMALL: usize = 9;
/// Costs of at most this much count as zero.
const TINY: f64 = 1e-200;
/// Costs that are handled side by side; blocks may be read this far past their end.
pub(super) const LANES: usize = 8;

/// Costs for the search over `m` clusters, one of which, the root, always stands at position 0.
#[derive(Default)]
pub(super) struct Table {
    pub(super) m: usize,
    pub(super) root: usize,
    pub(super) sizes: Vec<u32>,
    /// Reversing a stretch without the root leaves the costs inside it as they are.
    pub(super) reversible: bool,
    /// Mean over the clusters of the cheapest arc out of them: the scale of the temperature.
    pub(super) typical: f64,
    pairs: Vec<Pair>,
    transposed: Vec<u32>,
    data: Vec<i32>,
    lowest: Vec<i32>,
    /// The cheapest entry of each row of each block, and where a pair's begin.
    row_lowest: Vec<i32>,
    row_starts: Vec<u32>,
    near_out: Vec<u32>,
    near_in: Vec<u32>,
    near_cost: Vec<i32>,
    near_in_cost: Vec<i32>,
    near_start: Vec<(u32, u32)>,
    /// The root is the fixed start outside the clusters.
    pub(super) outer_root: bool,
    /// No arc leads to the root but the closing one, which is free.
    open: bool,
    /// The instance's nodes that this table's stand for, where it has not all of them.
    names: Option<Vec<Vec<u32>>>,
}

/// Where a block lies; absent blocks share one of zeros and add their price.
#[derive(Clone, Copy)]
struct Pair {
    at: u32,
    add: i32,
}

impl Table {
    /// The costs of an instance; `None` where 32 bits do not count them.
    pub(super) fn new(instance: &Instance) -> Option<Self> {
        let rooted = Rooted::new(instance)?;
        let (root, m) = (rooted.root, rooted.m);
        let sizes: Vec<u32> = (0..m).map(|a| rooted.size(a) as u32).collect();
        let mut blocks = Blocks::of(&rooted);
        let reversible = blocks.reversible(&rooted);
        let transposed = blocks.transpose(&rooted, reversible);
        let Blocks { pairs, mut data, lowest } = blocks;
        data.extend_from_slice(&[0; LANES]);
        let mut table = Self {
            m,
            root,
            sizes,
            reversible,
            typical: 1.0,
            pairs,
            transposed,
            data,
            lowest,
            outer_root: root >= instance.clusters(),
            open: *instance.ends() != Ends::Closed,
            names: None,
            // Filled in below.
            ..Self::default()
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
        let mut transposed = self.transposed.clone();
        let mut lowest = self.lowest.clone();
        for a in 0..m {
            for b in 0..m {
                let k = a * m + b;
                if self.pairs[k].at == 0 {
                    continue;
                }
                pairs[k].at = data.len() as u32;
                for &i in &nodes[a] {
                    let (_, row) = self.row(a as u32, i, b as u32);
                    data.extend(nodes[b].iter().map(|&j| row[j as usize]));
                }
                lowest[k] = data[pairs[k].at as usize..].iter().copied().min().unwrap_or(0);
            }
        }
        for a in 0..m {
            for b in 0..m {
                let k = a * m + b;
                if self.pairs[k].at == 0 {
                    continue;
                }
                if self.transposed[k] == self.pairs[b * m + a].at {
                    transposed[k] = pairs[b * m + a].at;
                } else {
                    transposed[k] = data.len() as u32;
                    for &j in &nodes[b] {
                        let (_, column) = self.column(a as u32, b as u32, j);
                        data.extend(nodes[a].iter().map(|&i| column[i as usize]));
                    }
                }
            }
        }
        data.extend_from_slice(&[0; LANES]);
        let mut table = Self {
            m,
            root: self.root,
            sizes,
            reversible: self.reversible,
            typical: self.typical,
            pairs,
            transposed,
            data,
            lowest,
            outer_root: self.outer_root,
            open: self.open,
            names: Some(nodes.to_vec()),
            // Filled in below.
            ..Self::default()
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

    /// Whether arcs from `a` to `b` are known one by one.
    pub(super) fn is_stored(&self, a: u32, b: u32) -> bool {
        self.pairs[a as usize * self.m + b as usize].at != 0
    }

    fn find_row_lowest(&mut self) {
        let m = self.m;
        let widest = self.sizes.iter().copied().max().unwrap_or(1) as usize;
        // Pairs that are not stored share a block of zeros.
        self.row_lowest = vec![0; widest];
        self.row_starts = vec![0; m * m];
        for a in 0..m {
            for b in 0..m {
                let at = self.pairs[a * m + b].at as usize;
                if at != 0 {
                    let (x, y) = (self.sizes[a] as usize, self.sizes[b] as usize);
                    self.row_starts[a * m + b] = self.row_lowest.len() as u32;
                    let rows = self.data[at..at + x * y].chunks_exact(y);
                    self.row_lowest.extend(rows.map(|row| row.iter().copied().min().unwrap_or(0)));
                }
            }
        }
    }

    fn find_candidates(&mut self) {
        let (m, open) = (self.m, self.open);
        let mut typical = 0.0;
        let mut counted = 0;
        for a in 0..m {
            let list =
                |cost: &dyn Fn(usize) -> i32, present: &dyn Fn(usize) -> bool, skip_root: bool| {
                    let mut list: Vec<(i32, usize)> = (0..m)
                        .filter(|&b| b != a && !(skip_root && b == self.root))
                        .filter(|&b| present(b))
                        .map(|b| (cost(b), b))
                        .collect();
                    list.sort_unstable();
                    list.truncate(NEAR);
                    list
                };
            let out = list(&|b| self.lowest[a * m + b], &|b| self.pairs[a * m + b].at != 0, open);
            let into = list(&|b| self.lowest[b * m + a], &|b| self.pairs[b * m + a].at != 0, false);
            if let Some(&(c, _)) = out.first() {
                typical += f64::from(c);
                counted += 1;
            }
            self.near_start.push((self.near_out.len() as u32, self.near_in.len() as u32));
            for (c, b) in out {
                self.near_out.push(b as u32);
                self.near_cost.push(c);
            }
            for (c, b) in into {
                self.near_in.push(b as u32);
                self.near_in_cost.push(c);
            }
        }
        self.near_start.push((self.near_out.len() as u32, self.near_in.len() as u32));
        self.typical = (typical / f64::from(counted.max(1))).max(1.0);
    }

    /// Cost from node `i` of `a` to node `j` of `b`.
    #[inline]
    pub(super) fn d(&self, a: u32, i: u32, b: u32, j: u32) -> i32 {
        let pair = self.pairs[a as usize * self.m + b as usize];
        pair.add + self.data[(pair.at + i * self.sizes[b as usize] + j) as usize]
    }

    /// Costs from node `i` of `a` to every node of `b`: what to add, and the row.
    #[inline]
    pub(super) fn row(&self, a: u32, i: u32, b: u32) -> (i32, &[i32]) {
        let pair = self.pairs[a as usize * self.m + b as usize];
        let width = self.sizes[b as usize];
        let at = (pair.at + i * width) as usize;
        (pair.add, &self.data[at..at + width as usize])
    }

    /// Costs from every node of `a` to node `j` of `b`.
    #[inline]
    pub(super) fn column(&self, a: u32, b: u32, j: u32) -> (i32, &[i32]) {
        let k = a as usize * self.m + b as usize;
        let height = self.sizes[a as usize];
        let at = (self.transposed[k] + j * height) as usize;
        (self.pairs[k].add, &self.data[at..at + height as usize])
    }

    /// The block from `a` to `b`, row-major.
    #[inline]
    pub(super) fn block(&self, a: u32, b: u32) -> (i32, &[i32]) {
        let pair = self.pairs[a as usize * self.m + b as usize];
        let count = (self.sizes[a as usize] * self.sizes[b as usize]) as usize;
        (pair.add, &self.data[pair.at as usize..pair.at as usize + count])
    }

    /// Cheapest arc from `a` to `b`.
    #[inline]
    pub(super) fn low(&self, a: u32, b: u32) -> i32 {
        self.lowest[a as usize * self.m + b as usize]
    }

    /// The block from `a` to `b` with the data that follow it, at least `LANES` entries.
    #[inline]
    pub(super) fn open_block(&self, a: u32, b: u32) -> (i32, &[i32]) {
        let pair = self.pairs[a as usize * self.m + b as usize];
        (pair.add, &self.data[pair.at as usize..])
    }

    /// For each node of `a` the cheapest entry of its row in [`Self::open_block`].
    #[inline]
    pub(super) fn row_lowest(&self, a: u32, b: u32) -> &[i32] {
        let at = self.row_starts[a as usize * self.m + b as usize] as usize;
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
        let range =
            self.near_start[a as usize].0 as usize..self.near_start[a as usize + 1].0 as usize;
        self.near_out[range.clone()].iter().copied().zip(self.near_cost[range].iter().copied())
    }

    /// Clusters from which `a` is cheap to reach, nearest first, with the cheapest arc.
    #[inline]
    pub(super) fn near_in(&self, a: u32) -> impl Iterator<Item = (u32, i32)> + '_ {
        let range =
            self.near_start[a as usize].1 as usize..self.near_start[a as usize + 1].1 as usize;
        self.near_in[range.clone()].iter().copied().zip(self.near_in_cost[range].iter().copied())
    }

    /// The instance's node that node `i` of cluster `c` stands for.
    #[inline]
    pub(super) fn instance_node(&self, c: u32, i: u32) -> u32 {
        self.names.as_ref().map_or(i, |names| names[c as usize][i as usize])
    }
}

/// The blocks of all cluster pairs, row by row, before they are transposed.
struct Blocks {
    pairs: Vec<Pair>,
    data: Vec<i32>,
    lowest: Vec<i32>,
}

impl Blocks {
    fn of(rooted: &Rooted<'_>) -> Self {
        let (m, widest) = (rooted.m, rooted.widest());
        let quantise = quantiser(rooted);
        let mut data = vec![0; widest * widest];
        let mut pairs = vec![Pair { at: 0, add: 0 }; m * m];
        let mut lowest = vec![i32::MAX; m * m];
        let mut row = Vec::new();
        for (a, b) in rooted.pairs() {
            let search_price = quantise(rooted.price(a, b));
            row.clear();
            let mut present = false;
            if rooted.maybe_adjacent(a, b) {
                for entry in rooted.entries(a, b) {
                    present |= entry.is_some();
                    row.push(entry.map_or(search_price, &quantise));
                }
            }
            if present {
                pairs[a * m + b] = Pair { at: data.len() as u32, add: 0 };
                lowest[a * m + b] = row.iter().copied().min().unwrap_or(i32::MAX);
                data.extend_from_slice(&row);
            } else {
                pairs[a * m + b] = Pair { at: 0, add: search_price };
                lowest[a * m + b] = search_price;
            }
        }
        Self { pairs, data, lowest }
    }

    /// Whether the costs between all clusters but the root are symmetric.
    fn reversible(&self, rooted: &Rooted<'_>) -> bool {
        let (m, root) = (rooted.m, rooted.root);
        rooted.pairs().all(|(a, b)| {
            a < b || a == root || b == root || {
                let (p, q) = (self.pairs[a * m + b], self.pairs[b * m + a]);
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

    /// Where each block lies column by column: the opposite block where that is the same.
    fn transpose(&mut self, rooted: &Rooted<'_>, reversible: bool) -> Vec<u32> {
        let (m, root) = (rooted.m, rooted.root);
        let mut transposed = vec![0; m * m];
        for (a, b) in rooted.pairs() {
            let p = self.pairs[a * m + b];
            if p.at == 0 {
                continue;
            }
            let back = self.pairs[b * m + a];
            transposed[a * m + b] = if reversible && a != root && b != root {
                back.at
            } else {
                let (x, y) = (rooted.size(a), rooted.size(b));
                let start = self.data.len();
                for j in 0..y {
                    for i in 0..x {
                        let value = self.data[p.at as usize + i * y + j];
                        self.data.push(value);
                    }
                }
                start as u32
            };
        }
        transposed
    }
}

/// Costs to integers, so that the sum of a whole tour fits 32 bits; the identity where the costs are
/// small integers.
fn quantiser(rooted: &Rooted<'_>) -> impl Fn(f64) -> i32 {
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
    let scale = if exact { 1.0 } else { room / ceiling };
    move |c| (c.clamp(-ceiling, ceiling) * scale).round() as i32
}
