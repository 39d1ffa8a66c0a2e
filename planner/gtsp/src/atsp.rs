//! Lin–Kernighan-style search for the asymmetric TSP: chains of sequential 3-exchanges that keep
//! every direction (Kanellakis & Papadimitriou, Oper. Res. 28, 1980), kicked by double bridges.

use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Length of the candidate lists.
const NEAR: usize = 8;
/// Longest chain of exchanges.
const DEPTH: usize = 6;
/// Longest stretch that a kick moves.
const KICK: usize = 50;

struct Search<'a> {
    cost: &'a [i64],
    n: usize,
    near_out: Vec<Vec<usize>>,
    near_in: Vec<Vec<usize>>,
    order: Vec<usize>,
    position: Vec<usize>,
    queue: Vec<usize>,
    queued: Vec<bool>,
}

/// An order of all `n` nodes of the row-major matrix: nearest neighbour, local search, then
/// `trials` kicks of which those are kept that do not lengthen the tour.
pub(super) fn search(
    cost: &[i64],
    n: usize,
    trials: u64,
    seed: u64,
    stop: &dyn Fn() -> bool,
) -> Vec<usize> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let order = nearest_neighbour(cost, n, rng.random_range(0..n));
    if n < 8 {
        return order;
    }
    let nearest = |of: usize, d: &dyn Fn(usize) -> i64| {
        let mut list: Vec<usize> = (0..n).filter(|&v| v != of).collect();
        list.sort_by_key(|&v| (d(v), v));
        list.truncate(NEAR);
        list
    };
    let mut search = Search {
        cost,
        n,
        near_out: (0..n).map(|u| nearest(u, &|v| cost[u * n + v])).collect(),
        near_in: (0..n).map(|u| nearest(u, &|v| cost[v * n + u])).collect(),
        position: vec![0; n],
        queue: (0..n).rev().collect(),
        queued: vec![true; n],
        order,
    };
    search.renumber(0, n - 1);
    search.improve();
    let mut kept = search.order.clone();
    for _ in 0..trials {
        if stop() {
            break;
        }
        let change = search.kick(&mut rng) + search.improve();
        if change <= 0 {
            kept.copy_from_slice(&search.order);
        } else {
            search.order.copy_from_slice(&kept);
            search.renumber(0, n - 1);
        }
    }
    kept
}

fn nearest_neighbour(cost: &[i64], n: usize, start: usize) -> Vec<usize> {
    let mut left: Vec<usize> = (0..n).filter(|&v| v != start).collect();
    let mut order = vec![start];
    while !left.is_empty() {
        let here = order[order.len() - 1];
        let next = (0..left.len()).min_by_key(|&k| cost[here * n + left[k]]).unwrap_or(0);
        order.push(left.swap_remove(next));
    }
    order
}

impl Search<'_> {
    fn d(&self, u: usize, v: usize) -> i64 {
        self.cost[u * self.n + v]
    }

    fn at(&self, p: usize) -> usize {
        self.order[p % self.n]
    }

    fn renumber(&mut self, first: usize, last: usize) {
        for p in first..=last {
            self.position[self.order[p]] = p;
        }
    }

    fn push(&mut self, u: usize) {
        if !std::mem::replace(&mut self.queued[u], true) {
            self.queue.push(u);
        }
    }

    /// Exchanges the stretches `first..middle` and `middle..=last`.
    fn exchange(&mut self, (first, middle, last): (usize, usize, usize)) {
        self.order[first..=last].rotate_left(middle - first);
        self.renumber(first, last);
    }

    /// Improves until no queued node starts an improving chain; the change of the cost.
    fn improve(&mut self) -> i64 {
        let mut change = 0;
        while let Some(u) = self.queue.pop() {
            self.queued[u] = false;
            loop {
                let gain = self.chain(u);
                change -= gain;
                if gain == 0 {
                    break;
                }
            }
        }
        change
    }

    /// Follows the best exchange at the arc out of `u`, then at the arc that closed it, as long as
    /// the gain without the closing arc is positive; keeps the best prefix and returns its gain.
    fn chain(&mut self, u: usize) -> i64 {
        let mut done: Vec<(usize, usize, usize)> = Vec::with_capacity(DEPTH);
        let (mut total, mut best) = (0, (0, 0));
        let mut here = u;
        let mut ends = Vec::new();
        for _ in 0..DEPTH {
            let Some((gain, open, exchange)) = self.best_exchange(here) else { break };
            if total + open <= 0 {
                break;
            }
            let (first, middle, last) = exchange;
            for p in [first + self.n - 1, first, middle - 1, middle, last, last + 1] {
                ends.push(self.at(p));
            }
            let next = self.at(if self.position[here] + 1 == first {
                middle - 1
            } else {
                first + self.n - 1
            });
            self.exchange(exchange);
            done.push(exchange);
            total += gain;
            if total > best.0 {
                best = (total, done.len());
            }
            here = next;
        }
        while done.len() > best.1 {
            if let Some((first, middle, last)) = done.pop() {
                self.exchange((first, first + last + 1 - middle, last));
            }
        }
        if best.0 > 0 {
            for v in ends {
                self.push(v);
            }
        }
        best.0
    }

    /// Exchange of two neighbouring stretches that removes the arc out of `u`: (gain, gain without
    /// the closing arc, positions), the one of the largest gain.
    fn best_exchange(&self, u: usize) -> Option<(i64, i64, (usize, usize, usize))> {
        let n = self.n;
        let p = self.position[u];
        let next = self.at(p + 1);
        let ahead = self.d(u, next);
        let mut best: Option<(i64, i64, (usize, usize, usize))> = None;
        for &v in &self.near_out[u] {
            let g1 = ahead - self.d(u, v);
            if g1 <= 0 {
                break;
            }
            let q = self.position[v];
            if q == 0 || q == p + 1 {
                continue;
            }
            let g2 = g1 + self.d(self.at(q - 1), v);
            for &w in &self.near_in[next] {
                let r = self.position[w];
                let open = g2 - self.d(w, next) + self.d(w, self.at(r + 1));
                if g2 - self.d(w, next) <= 0 {
                    break;
                }
                let exchange = if q > p + 1 && r >= q && p + 1 < n {
                    (p + 1, q, r)
                } else if q < p && r >= q && r < p {
                    (q, r + 1, p)
                } else {
                    continue;
                };
                let gain = open - self.d(self.at(q - 1), self.at(r + 1));
                if best.is_none_or(|b| gain > b.0) {
                    best = Some((gain, open, exchange));
                }
            }
        }
        best
    }

    /// A double bridge of three stretches turned around in order; the change of the cost.
    fn kick(&mut self, rng: &mut impl Rng) -> i64 {
        let longest = KICK.min((self.n - 2) / 3);
        let l = [0; 3].map(|_| rng.random_range(1..=longest));
        let all = l[0] + l[1] + l[2];
        let first = rng.random_range(1..=self.n - all);
        let last = first + all - 1;
        let sum = |s: &Self| (first - 1..=last).map(|p| s.d(s.at(p), s.at(p + 1))).sum::<i64>();
        let before = sum(self);
        self.exchange((first, first + l[0], last));
        self.exchange((first, first + l[1], first + l[1] + l[2] - 1));
        for p in [first - 1, first + l[2] - 1, first + l[2] + l[1] - 1, last] {
            let (u, v) = (self.at(p), self.at(p + 1));
            self.push(u);
            self.push(v);
        }
        sum(self) - before
    }
}
