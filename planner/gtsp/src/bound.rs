//! Lower bounds from the cheapest arcs between clusters.
//!
//! Every tour takes one arc out of each cluster and one into it, and costs no less than the
//! cheapest arcs of the cluster pairs that it joins. So the assignment problem over those arcs is a
//! lower bound, and where they are symmetric the 1-tree bound of Held & Karp (Oper. Res. 18, 1970)
//! with subgradient ascent is another.

use crate::closed::Closed;
use crate::instance::Instance;

/// Clusters and node pairs up to which the bounds are cheap.
const MOST_CLUSTERS: usize = 600;
const MOST_PAIRS: usize = 4_000_000;
/// Steps of the subgradient ascent.
const STEPS: usize = 200;

/// A number that no tour costs less than, in the unit of the costs; `None` for instances of fewer
/// than 3 or more than 600 clusters (the fixed start of an open path counts as one) or of more than
/// 2000 nodes, and where some cluster cannot be reached from another by an arc or a jump.
pub fn lower_bound(instance: &Instance) -> Option<f64> {
    let closed = Closed::new(instance);
    let (n, m) = (closed.nodes.len(), closed.clusters);
    if !(3..=MOST_CLUSTERS).contains(&m) || n * n > MOST_PAIRS {
        return None;
    }
    let mut low = vec![f64::INFINITY; m * m];
    for u in 0..n {
        for v in 0..n {
            if let Some(w) = closed.weight(u, v) {
                let slot = &mut low[closed.nodes[u].0 * m + closed.nodes[v].0];
                *slot = slot.min(w);
            }
        }
    }
    if (0..m * m).any(|k| k / m != k % m && low[k].is_infinite()) {
        return None;
    }
    let mut bound = assignment(m, &low);
    if (0..m * m).all(|k| k / m == k % m || low[k] == low[(k % m) * m + k / m]) {
        bound = bound.max(one_tree(m, &low));
    }
    // Rounding errors of the sums must not lift the bound above an optimum.
    Some(bound - 1e-9 * bound.abs())
}

/// Cost of the cheapest permutation without fixed points (shortest augmenting paths).
fn assignment(m: usize, cost: &[f64]) -> f64 {
    let mut row_price = vec![0.0; m + 1];
    let mut column_price = vec![0.0; m + 1];
    // Row matched with each column; 0 is none, rows and columns count from 1.
    let mut row_of = vec![0; m + 1];
    for row in 1..=m {
        row_of[0] = row;
        let mut column = 0;
        let mut slack = vec![f64::INFINITY; m + 1];
        let mut previous = vec![0; m + 1];
        let mut done = vec![false; m + 1];
        while row_of[column] != 0 {
            done[column] = true;
            let r = row_of[column];
            let (mut step, mut next) = (f64::INFINITY, 0);
            for c in 1..=m {
                if done[c] {
                    continue;
                }
                let reduced = cost[(r - 1) * m + c - 1] - row_price[r] - column_price[c];
                if reduced < slack[c] {
                    slack[c] = reduced;
                    previous[c] = column;
                }
                if slack[c] < step {
                    (step, next) = (slack[c], c);
                }
            }
            for c in 0..=m {
                if done[c] {
                    row_price[row_of[c]] += step;
                    column_price[c] -= step;
                } else {
                    slack[c] -= step;
                }
            }
            column = next;
        }
        while column != 0 {
            row_of[column] = row_of[previous[column]];
            column = previous[column];
        }
    }
    (1..=m).map(|c| cost[(row_of[c] - 1) * m + c - 1]).sum()
}

/// Held and Karp's bound: 1-trees under node prices that punish degrees other than 2.
fn one_tree(m: usize, cost: &[f64]) -> f64 {
    let mut price = vec![0.0; m];
    let mut best = f64::NEG_INFINITY;
    let mut last = vec![0.0; m];
    let scale =
        cost.iter().filter(|c| c.is_finite()).fold(0.0, |s: f64, c| s + c.abs()) / (m * m) as f64;
    for step in 0..STEPS {
        let (value, degree) = tree(m, cost, &price);
        best = best.max(value - 2.0 * price.iter().sum::<f64>());
        let size = 0.1 * scale * (1.0 - step as f64 / STEPS as f64);
        for k in 0..m {
            let slope = f64::from(degree[k]) - 2.0;
            price[k] += size * (0.7 * slope + 0.3 * last[k]);
            last[k] = slope;
        }
    }
    best
}

/// Cheapest spanning tree on 1.. and the two cheapest arcs at 0; cost and degrees.
fn tree(m: usize, cost: &[f64], price: &[f64]) -> (f64, Vec<u32>) {
    let length = |a: usize, b: usize| cost[a * m + b] + price[a] + price[b];
    let mut degree = vec![0; m];
    let mut total = 0.0;
    let mut near = vec![(f64::INFINITY, 1); m];
    let mut inside = vec![false; m];
    let mut joined = 1;
    inside[1] = true;
    for _ in 2..m {
        let mut next = (f64::INFINITY, 0);
        for k in 2..m {
            if !inside[k] {
                let l = length(joined, k);
                if l < near[k].0 {
                    near[k] = (l, joined);
                }
                if near[k].0 < next.0 {
                    next = (near[k].0, k);
                }
            }
        }
        total += next.0;
        degree[next.1] += 1;
        degree[near[next.1].1] += 1;
        inside[next.1] = true;
        joined = next.1;
    }
    let mut ends: Vec<(f64, usize)> = (1..m).map(|k| (length(0, k), k)).collect();
    ends.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    for &(l, k) in &ends[..2] {
        total += l;
        degree[k] += 1;
        degree[0] += 1;
    }
    (total, degree)
}
