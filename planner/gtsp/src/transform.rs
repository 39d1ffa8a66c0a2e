//! The transformation into an asymmetric TSP, which a Lin–Kernighan-style search then solves.
//!
//! Behzad & Modarres, "A new efficient transformation of the generalized traveling salesman problem
//! into traveling salesman problem", 2002: inside a cluster v₁ … vᵣ the arcs vⱼ → vⱼ₊₁ (cyclic) cost
//! 0 and all others are forbidden; between clusters c'(vⱼ, w) = c(vⱼ₊₁, w) + B. With B above any
//! tour's cost an optimal tour passes through each cluster in one run, the first node of which is
//! the chosen one, and costs the optimum + m·B.

use crate::atsp;
use crate::closed::Closed;
use crate::instance::Instance;
use crate::tour::{Tour, TourCost};

/// The asymmetric TSP of an instance, for any solver of those.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Transformed {
    /// Row-major n×n over the nodes in cluster order (and the fixed start, if there is one).
    pub matrix: Vec<i64>,
    /// Number of nodes.
    pub nodes: usize,
    /// Number of clusters, the fixed start's included.
    pub clusters: usize,
    /// B, added to every arc between clusters.
    pub penalty: i64,
    /// Entries are costs × scale (+ B), rounded.
    pub scale: f64,
    cluster_of: Vec<usize>,
}

/// Largest sum of costs that the matrix is scaled to.
const LARGEST_SUM: f64 = 1e9;

/// The instance as an asymmetric TSP over single nodes; the matrix takes 8 bytes for each pair of
/// nodes.
pub fn transform(instance: &Instance) -> Transformed {
    let closed = Closed::new(instance);
    let (n, m) = (closed.nodes.len(), closed.clusters);
    let (mut largest, mut whole) = (f64::MIN_POSITIVE, true);
    for w in (0..n * n).filter_map(|k| closed.weight(k / n, k % n)) {
        largest = largest.max(w.abs());
        whole &= w.fract() == 0.0;
    }
    let sum = largest * m as f64;
    let scale = if whole && sum <= LARGEST_SUM { 1.0 } else { LARGEST_SUM / sum };
    let penalty = 2 * (sum * scale).ceil() as i64 + 1;
    let forbidden = penalty * (m as i64 + 1);
    let cluster_of: Vec<usize> = closed.nodes.iter().map(|k| k.0).collect();
    // The next node of the same cluster, cyclic: nodes of a cluster stand side by side.
    let next = |u: usize| {
        let same = |v: usize| cluster_of.get(v) == Some(&cluster_of[u]);
        if same(u + 1) { u + 1 } else { (0..=u).rev().take_while(|&v| same(v)).last().unwrap_or(u) }
    };
    let mut matrix = vec![forbidden; n * n];
    for u in 0..n {
        let leaves = next(u);
        if leaves != u {
            matrix[u * n + leaves] = 0;
        }
        for v in (0..n).filter(|&v| cluster_of[v] != cluster_of[u]) {
            if let Some(w) = closed.weight(leaves, v) {
                matrix[u * n + v] = (w * scale).round() as i64 + penalty;
            }
        }
    }
    Transformed { matrix, nodes: n, clusters: m, penalty, scale, cluster_of }
}

impl Transformed {
    /// The instance's tour from an order of the ATSP's nodes: the first node of each cluster in
    /// the order in which the clusters are first met. `None` where the order lacks a fixed start.
    ///
    /// # Panics
    /// Where the order names a node that does not exist.
    pub fn tour(&self, instance: &Instance, order: &[usize]) -> Option<Tour> {
        let n = order.len();
        let cluster = |k: usize| self.cluster_of[order[k % n]];
        // Begin where a run begins.
        let first = (0..n).find(|&k| cluster(k + n - 1) != cluster(k)).unwrap_or(0);
        let mut met = vec![false; self.clusters];
        let indices: Vec<usize> = (first..first + n)
            .filter(|&k| !std::mem::replace(&mut met[cluster(k)], true))
            .map(|k| order[k % n])
            .collect();
        Closed::new(instance).tour(&indices)
    }
}

/// Tour of the transformed instance's Lin–Kernighan-style search after `trials` kicks, and its
/// cost; `stop` is asked before each kick and ends it early. A baseline to compare
/// [`solve`](crate::solve) with.
pub fn solve_transformed(
    instance: &Instance,
    trials: u64,
    seed: u64,
    stop: &dyn Fn() -> bool,
) -> (Tour, TourCost) {
    let transformed = transform(instance);
    let order = atsp::search(&transformed.matrix, transformed.nodes, trials, seed, stop);
    let tour = transformed.tour(instance, &order).expect("the search returns every node once");
    let cost = tour.cost(instance);
    (tour, cost)
}
