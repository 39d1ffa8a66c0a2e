//! Lower bounds by Lagrangian relaxation: 1-trees between clusters under prices of their nodes.
//!
//! A tour is a 1-tree (asymmetric: a 1-arborescence) between clusters, as in Held & Karp (Oper. Res.
//! 18, 1970), which keeps two rules more: each cluster has two links, and a cluster is left from
//! the node at which it was entered. Breaking a rule is priced; whatever the prices, the cheapest
//! 1-tree costs no more than the cheapest tour, and a subgradient ascent raises it.

mod cuts;
mod prices;
mod tree;

use std::time::{Duration, Instant};

use crate::closed::Closed;
use crate::instance::Instance;
use crate::tour::Tour;
use cuts::Support;
use prices::{Link, Prices};
use tree::{Joined, one_arborescence, one_tree};

/// Clusters and nodes up to which there is a bound.
const MOST_CLUSTERS: usize = 700;
const MOST_NODES: usize = 4000;
/// The ascent looks at all links after so many steps, else at those that were of use so far.
const ROUND: u64 = 100;
/// After so many steps it looks for sets of nodes that the links do not leave.
const CUTS: u64 = 200;
/// Most of them at a time.
const MOST_CUTS: usize = 200;
/// What one step counts in the mean of the last ones.
const SHARE: f64 = 0.02;
/// Links of a node that are looked at from the start.
const NEAREST: usize = 12;
/// Rounds without progress after which the steps become shorter, and by how much.
const PATIENCE: u32 = 15;
const SHORTER: f64 = 0.7;
/// The length of a step, in units of Polyak's, at first and when the ascent ends.
const LONGEST: f64 = 1.0;
const SHORTEST: f64 = 1e-4;

/// Limits on the ascent; it ends also where it no longer rises. Without a time limit the bound
/// depends on the instance, the tour and the steps alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Most steps.
    pub steps: u64,
    /// Wall-clock limit.
    pub time: Option<Duration>,
}

/// A number that no tour costs less than, in the unit of the costs, found with the help of a good
/// tour; `None` for instances of fewer than 3 or more than 700 clusters (the fixed start of an open
/// path counts as one) or of more than 4000 nodes, and where the tour does not fit or has a
/// forbidden jump.
pub fn lower_bound(instance: &Instance, tour: &Tour, effort: Effort) -> Option<f64> {
    let started = Instant::now();
    tour.check(instance).ok()?;
    let upper = tour.cost(instance).total();
    let closed = Closed::new(instance);
    let fits = (3..=MOST_CLUSTERS).contains(&closed.clusters) && closed.nodes.len() <= MOST_NODES;
    if !fits || !upper.is_finite() {
        return None;
    }
    let mut ascent = Ascent::new(&closed, &closed.indices(tour));
    let whole = ascent.links.iter().all(|cost| cost.is_infinite() || cost.fract() == 0.0);
    let stop = || effort.time.is_some_and(|t| started.elapsed() >= t);
    // Rounding errors of the sums must not lift the bound above an optimum.
    let safe = |bound: f64| {
        let bound = bound - 1e-9 * (bound.abs() + upper.abs());
        if whole { (bound - 1e-3).ceil() } else { bound }
    };
    let bound = safe(ascent.climb(upper, effort.steps, &|best| safe(best) >= upper || stop()));
    Some(bound.min(upper))
}

/// The state of the ascent.
struct Ascent {
    m: usize,
    symmetric: bool,
    /// Cluster of each node.
    cluster: Vec<u32>,
    /// Cost of every link, row-major; infinite where there is none.
    links: Vec<f64>,
    /// The links that the ascent looks at in most steps, and whether each one is among them.
    looked_at: Vec<Link>,
    /// Whether the last 1-tree has each of them, and how much of it the last ones had in the mean.
    chosen: Vec<bool>,
    mean: Vec<f64>,
    known: Vec<bool>,
    prices: Prices,
    /// The cheapest link between each two clusters under the present prices: what it then costs,
    /// and its number.
    cheapest: Vec<f64>,
    number: Vec<u32>,
}

impl Ascent {
    fn new(closed: &Closed<'_>, tour: &[usize]) -> Self {
        let (m, n) = (closed.clusters, closed.nodes.len());
        let cluster: Vec<u32> = closed.nodes.iter().map(|&(c, _)| c as u32).collect();
        let weight = |k: usize| closed.weight(k / n, k % n).unwrap_or(f64::INFINITY);
        let links: Vec<f64> = (0..n * n).map(weight).collect();
        let symmetric = (0..n).all(|u| (0..u).all(|v| links[u * n + v] == links[v * n + u]));
        let mut ascent = Self {
            m,
            symmetric,
            prices: Prices::new(cluster.clone(), m, symmetric),
            cluster,
            known: vec![false; n * n],
            links,
            looked_at: Vec::new(),
            chosen: Vec::new(),
            mean: Vec::new(),
            cheapest: vec![f64::INFINITY; m * m],
            number: vec![0; m * m],
        };
        for k in 0..m {
            ascent.look_at(tour[k], tour[(k + 1) % m]);
        }
        for u in 0..n {
            let cost = |v: usize| ascent.links[u * n + v];
            let mut near: Vec<usize> = (0..n).filter(|&v| cost(v).is_finite()).collect();
            near.sort_by(|&v, &w| cost(v).total_cmp(&cost(w)).then(v.cmp(&w)));
            near.truncate(NEAREST);
            for v in near {
                ascent.look_at(u, v);
            }
        }
        ascent
    }

    /// Has the ascent look at a link in every step.
    fn look_at(&mut self, u: usize, v: usize) {
        let n = self.cluster.len();
        let (u, v) = if self.symmetric { (u.min(v), u.max(v)) } else { (u, v) };
        let cost = self.links[u * n + v];
        if !std::mem::replace(&mut self.known[u * n + v], true) {
            self.looked_at.push(self.prices.link(u as u32, v as u32, cost));
            self.chosen.push(false);
            self.mean.push(0.0);
        }
    }

    /// Raises the bound as far as it goes; the best one.
    fn climb(&mut self, upper: f64, steps: u64, done: &dyn Fn(f64) -> bool) -> f64 {
        let mut best = f64::NEG_INFINITY;
        let (mut length, mut idle) = (LONGEST, 0);
        for step in 0.. {
            if step % ROUND == 0 {
                let (value, chosen) = self.cheapest_of_all();
                for &(u, v) in &chosen {
                    self.look_at(u as usize, v as usize);
                }
                let progress = value > best + 1e-5 * (upper - best);
                best = best.max(value);
                idle = if progress { 0 } else { idle + 1 };
                if idle > PATIENCE {
                    (length, idle) = (length * SHORTER, 0);
                }
                if step >= steps || length < SHORTEST || done(best) {
                    return best;
                }
            }
            let value = self.cheapest_looked_at();
            let rise = length * (upper - value).max(0.0);
            self.prices.step(&self.looked_at, &self.chosen, rise);
            if step % CUTS == CUTS - 1 {
                self.look_for_cuts((step / CUTS) as usize);
            }
        }
        best
    }

    /// Has the sets priced that the links do not leave as often as they should, in the mean of the
    /// last steps: near and far ones in turn.
    fn look_for_cuts(&mut self, turn: usize) {
        let links = self.looked_at.iter().zip(&self.mean);
        let links = links.map(|(link, &amount)| (link.from, link.to, amount));
        let links = links.filter(|&(.., amount)| amount > 1e-3);
        let mut support = Support::new(&self.cluster, self.m, links);
        // Every time another cluster is to lie outside.
        let around = (turn * 7919 % self.m, 40 << (2 * (turn % 3)));
        let cuts = support.violated(&self.cluster, around, MOST_CUTS);
        self.prices.add_cuts(cuts, &self.looked_at);
    }

    /// Chooses the cheapest 1-tree of the links that are looked at; its cost less the prices.
    fn cheapest_looked_at(&mut self) -> f64 {
        self.cheapest.fill(f64::INFINITY);
        for (k, link) in self.looked_at.iter().enumerate() {
            let [a, b] = [link.from, link.to].map(|u| self.cluster[u as usize] as usize);
            let at = a * self.m + b;
            let cost = self.prices.priced(k, link);
            if cost < self.cheapest[at] {
                (self.cheapest[at], self.number[at]) = (cost, k as u32);
            }
        }
        let (value, joined) = self.join();
        self.chosen.fill(false);
        joined.into_iter().for_each(|k| self.chosen[k as usize] = true);
        for (mean, &chosen) in self.mean.iter_mut().zip(&self.chosen) {
            *mean += SHARE * (f64::from(u8::from(chosen)) - *mean);
        }
        value
    }

    /// The same of all links: a bound.
    fn cheapest_of_all(&mut self) -> (f64, Vec<(u32, u32)>) {
        let n = self.cluster.len();
        let mut costs = self.links.clone();
        self.prices.add_to_all(&mut costs);
        self.cheapest.fill(f64::INFINITY);
        for u in 0..n {
            let a = self.cluster[u] as usize;
            for v in if self.symmetric { u + 1 } else { 0 }..n {
                let at = a * self.m + self.cluster[v] as usize;
                if costs[u * n + v] < self.cheapest[at] {
                    (self.cheapest[at], self.number[at]) = (costs[u * n + v], (u * n + v) as u32);
                }
            }
        }
        let (value, joined) = self.join();
        (value, joined.into_iter().map(|k| (k / n as u32, k % n as u32)).collect())
    }

    /// The cheapest 1-tree of the cheapest links between clusters: its cost less the prices, and
    /// the numbers of its links.
    fn join(&mut self) -> (f64, Vec<u32>) {
        let m = self.m;
        if self.symmetric {
            for a in 0..m {
                for b in 0..a {
                    let (x, y) = (a * m + b, b * m + a);
                    let (low, high) =
                        if self.cheapest[x] <= self.cheapest[y] { (x, y) } else { (y, x) };
                    self.cheapest[high] = self.cheapest[low];
                    self.number[high] = self.number[low];
                }
            }
        }
        let Joined { cost, pairs } = if self.symmetric {
            one_tree(m, &self.cheapest)
        } else {
            one_arborescence(m, &self.cheapest)
        };
        let links = pairs.into_iter().map(|(a, b)| self.number[a * m + b]).collect();
        (cost - self.prices.total(), links)
    }
}
