//! The instance as the search sees it: with a root cluster, large entries that mean "no arc" taken
//! for jumps, and only as many cost blocks as there is room for.

use std::sync::Arc;

use rayon::prelude::*;

use crate::instance::{Ends, Instance, Jump};

/// Where the largest entry makes up at least this share of all, it stands for "no arc".
const BIG_M_SHARE: f64 = 0.3;
/// Entries of cost blocks that the search keeps, 4 bytes each.
const ROOM: usize = 1 << 28;
/// Clusters whose pairs are all listed, at some 20 bytes each.
const MOST_CLUSTERS: usize = 2000;
/// Neighbours of each cluster whose blocks are kept where all would not fit.
const KEPT: usize = 24;
/// Of so many that are nearest by their first nodes, those are taken.
const SHORTLIST: usize = 96;

/// The instance with its root.
pub(super) struct Rooted<'a> {
    pub(super) instance: &'a Instance,
    /// Number of clusters, the fixed start's included.
    pub(super) m: usize,
    /// The start of an open path, else the smallest cluster.
    pub(super) root: usize,
    pub(super) statistics: Statistics,
    /// The clusters near each one, ascending, where not all pairs are kept.
    kept: Option<Arc<[Vec<u32>]>>,
}

/// What all costs together say.
#[derive(Default)]
pub(super) struct Statistics {
    /// The scale of the arcs: the largest magnitude, or the largest cost below `big_m`.
    pub(super) largest: f64,
    pub(super) integers: bool,
    /// The entry that stands for "no arc", if one does.
    pub(super) big_m: Option<f64>,
}

impl<'a> Rooted<'a> {
    /// `None` where 32 bits do not count the costs that are kept.
    pub(super) fn new(instance: &'a Instance) -> Option<Self> {
        let clusters = instance.clusters();
        let (root, m) = match *instance.ends() {
            Ends::OpenFromCosts(_) => (clusters, clusters + 1),
            Ends::OpenFromCluster(start) => (start, clusters),
            Ends::Closed => {
                ((0..clusters).min_by_key(|&c| instance.sizes()[c]).unwrap_or(0), clusters)
            }
        };
        let mut rooted = Self { instance, m, root, statistics: Statistics::default(), kept: None };
        rooted.keep_what_fits();
        // By rows and by columns, and the block of zeros that absent ones share.
        let entries = 2 * rooted.stored_entries() + rooted.widest() * rooted.widest();
        u32::try_from(entries).ok()?;
        rooted.statistics = statistics(&rooted);
        Some(rooted)
    }

    /// Number of nodes; the fixed start has one.
    pub(super) fn size(&self, a: usize) -> usize {
        self.instance.sizes().get(a).copied().unwrap_or(1)
    }

    /// Largest number of nodes of a cluster.
    pub(super) fn widest(&self) -> usize {
        self.instance.sizes().iter().copied().max().unwrap_or(1)
    }

    /// Whether the search sees some arc from `a` to `b`.
    pub(super) fn maybe_adjacent(&self, a: usize, b: usize) -> bool {
        a >= self.instance.clusters()
            || b >= self.instance.clusters()
            || self.instance.adjacent(a, b)
            || self.enters_root(b)
    }

    /// Whether an arc to `b` only closes an open path.
    pub(super) fn enters_root(&self, b: usize) -> bool {
        b == self.root && *self.instance.ends() != Ends::Closed
    }

    /// Cost of an arc; `None` where only a jump leads there.
    pub(super) fn arc(&self, a: usize, i: usize, b: usize, j: usize) -> Option<f64> {
        if self.enters_root(b) {
            return Some(0.0); // the closing arc of an open path
        }
        let arc = match self.instance.ends() {
            Ends::OpenFromCosts(start) if a == self.root => {
                Some(start[self.instance.node_index(b, j)]).filter(|c| c.is_finite())
            }
            _ => self.instance.arc(a, i, b, j),
        };
        arc.filter(|c| Some(*c) != self.statistics.big_m)
    }

    /// Price of a jump.
    pub(super) fn price(&self, a: usize, b: usize) -> f64 {
        if let Some(price) = self.statistics.big_m {
            return price;
        }
        if self.enters_root(b) {
            0.0 // never asked for: that arc always exists
        } else if a >= self.instance.clusters() {
            self.instance.start_jump_price()
        } else {
            self.instance.jump_price(a, b)
        }
    }

    /// The clusters near each one, ascending, both ways, where the search sees no others' arcs.
    pub(super) fn kept(&self) -> Option<&Arc<[Vec<u32>]>> {
        self.kept.as_ref()
    }

    /// Where the blocks would need too much room, keeps those to and from the nearest clusters.
    fn keep_what_fits(&mut self) {
        // Asymmetric costs are stored by rows and by columns.
        if self.m <= MOST_CLUSTERS && 2 * self.stored_entries() <= ROOM {
            return;
        }
        let near: Vec<Vec<u32>> = (0..self.m).into_par_iter().map(|a| self.nearest(a)).collect();
        let mut kept = near.clone();
        for (a, near) in near.iter().enumerate() {
            for &b in near {
                kept[b as usize].push(a as u32);
            }
        }
        if *self.instance.ends() != Ends::Closed {
            for c in (0..self.m).filter(|&c| c != self.root) {
                kept[c].push(self.root as u32);
                kept[self.root].push(c as u32);
            }
        }
        for list in &mut kept {
            list.sort_unstable();
            list.dedup();
        }
        self.kept = Some(kept.into());
    }

    /// The clusters that are nearest to `a` by a few nodes of each.
    fn nearest(&self, a: usize) -> Vec<u32> {
        let few = |c: usize, most: usize| (0..self.size(c)).step_by(self.size(c).div_ceil(most));
        let low = |b: usize, most: usize| {
            let arcs = few(a, most).flat_map(|i| few(b, most).map(move |j| (i, j)));
            arcs.filter_map(|(i, j)| self.arc(a, i, b, j)).fold(f64::INFINITY, f64::min)
        };
        let adjacent = (0..self.m).filter(|&b| a != b && self.maybe_adjacent(a, b));
        let mut near: Vec<(f64, u32)> = adjacent.map(|b| (low(b, 1), b as u32)).collect();
        let by_cost = |x: &(f64, u32), y: &(f64, u32)| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1));
        for (count, most) in [(SHORTLIST, 4), (KEPT, 0)] {
            if near.len() > count {
                near.select_nth_unstable_by(count, by_cost);
                near.truncate(count);
            }
            if most > 0 {
                near.iter_mut().for_each(|(cost, b)| *cost = low(*b as usize, most));
            }
        }
        // A list of its own: `into_iter` would keep the room for all clusters.
        near.iter().map(|&(_, b)| b).collect()
    }

    /// Entries of the blocks that the search sees.
    fn stored_entries(&self) -> usize {
        self.pairs()
            .filter(|&(a, b)| self.maybe_adjacent(a, b))
            .map(|(a, b)| self.size(a) * self.size(b))
            .sum()
    }

    /// The ordered pairs of different clusters that the search sees.
    pub(super) fn pairs(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.m).flat_map(move |a| {
            let (all, near) = match &self.kept {
                None => (0..self.m, [].as_slice()),
                Some(kept) => (0..0, kept[a].as_slice()),
            };
            let all = all.filter(move |&b| a != b);
            all.chain(near.iter().map(|&b| b as usize)).map(move |b| (a, b))
        })
    }

    /// Costs from every node of `a` to every node of `b`, row by row.
    pub(super) fn entries(&self, a: usize, b: usize) -> impl Iterator<Item = Option<f64>> + '_ {
        let adjacent = self.maybe_adjacent(a, b);
        (0..self.size(a))
            .flat_map(move |i| (0..self.size(b)).map(move |j| (i, j)))
            .map(move |(i, j)| if adjacent { self.arc(a, i, b, j) } else { None })
    }
}

fn statistics(rooted: &Rooted<'_>) -> Statistics {
    let mut largest = f64::NEG_INFINITY;
    let mut magnitude: f64 = 0.0;
    let mut integers = true;
    let (mut entries, mut at_largest) = (0_u64, 0_u64);
    for (a, b) in rooted.pairs() {
        if !rooted.maybe_adjacent(a, b) || rooted.enters_root(b) {
            continue;
        }
        for cost in rooted.entries(a, b) {
            entries += 1;
            let Some(cost) = cost else { continue };
            integers &= cost.fract() == 0.0;
            magnitude = magnitude.max(cost.abs());
            if cost > largest {
                (largest, at_largest) = (cost, 0);
            }
            at_largest += u64::from(cost == largest);
        }
    }
    let complete = !matches!(rooted.instance.jump(), Jump::Table(_));
    let common = at_largest as f64 >= BIG_M_SHARE * entries as f64;
    if complete && common && largest > 0.0 {
        // The largest of the rest is the scale of the arcs; without a rest all costs are equal.
        let rest = rooted
            .pairs()
            .filter(|&(_, b)| !rooted.enters_root(b))
            .flat_map(|(a, b)| rooted.entries(a, b));
        let below = rest
            .flatten()
            .filter(|&c| c < largest)
            .fold(None, |m: Option<f64>, c| Some(m.map_or(c, |m| m.max(c))));
        let same_price = match rooted.instance.jump() {
            Jump::Uniform(h) => *h == largest || entries_are_finite(rooted),
            _ => entries_are_finite(rooted),
        };
        if let Some(below) = below.filter(|&below| below > 0.0 && same_price) {
            return Statistics { largest: below, integers, big_m: Some(largest) };
        }
    }
    Statistics { largest: magnitude, integers, big_m: None }
}

fn entries_are_finite(rooted: &Rooted<'_>) -> bool {
    rooted
        .pairs()
        .all(|(a, b)| rooted.maybe_adjacent(a, b) && rooted.entries(a, b).all(|e| e.is_some()))
}
