//! Every instance as a closed one over single nodes: the form that files, the transformation and
//! the bounds share.

use crate::instance::{Ends, Instance};
use crate::tour::Tour;

/// The nodes of all clusters in order, then the fixed start of a path that is open from start
/// costs; arcs back to the start of an open path are free.
pub(super) struct Closed<'a> {
    instance: &'a Instance,
    /// Cluster and node of each index; the added start is a cluster of its own behind the others.
    pub(super) nodes: Vec<(usize, usize)>,
    /// Number of clusters, the added start's included.
    pub(super) clusters: usize,
    /// Index of the added start.
    pub(super) start: Option<usize>,
}

impl<'a> Closed<'a> {
    pub(super) fn new(instance: &'a Instance) -> Self {
        let outer = matches!(instance.ends(), Ends::OpenFromCosts(_));
        let count = instance.clusters();
        let nodes = (0..count)
            .flat_map(|c| (0..instance.sizes()[c]).map(move |k| (c, k)))
            .chain(outer.then_some((count, 0)))
            .collect();
        let start = outer.then_some(instance.nodes());
        Self { instance, nodes, clusters: count + usize::from(outer), start }
    }

    /// Cost from one index to another, jumps at their price; `None` inside a cluster and where a
    /// jump is forbidden.
    pub(super) fn weight(&self, u: usize, v: usize) -> Option<f64> {
        let ((a, i), (b, j)) = (self.nodes[u], self.nodes[v]);
        if a == b {
            return None;
        }
        let instance = self.instance;
        let price = |p: f64| p.is_finite().then_some(p);
        match instance.ends() {
            Ends::OpenFromCosts(_) if Some(v) == self.start => Some(0.0),
            Ends::OpenFromCosts(start) if Some(u) == self.start => {
                if start[v].is_finite() {
                    Some(start[v])
                } else {
                    price(instance.start_jump_price())
                }
            }
            &Ends::OpenFromCluster(first) if b == first => Some(0.0),
            _ => instance.arc(a, i, b, j).or_else(|| price(instance.jump_price(a, b))),
        }
    }

    /// The indices of an instance's tour in closed order.
    pub(super) fn indices(&self, tour: &Tour) -> Vec<usize> {
        let places = tour.clusters.iter().zip(&tour.nodes);
        let nodes = places.map(|(&c, &k)| self.instance.node_index(c, k));
        self.start.into_iter().chain(nodes).collect()
    }

    /// The instance's tour from indices in closed order.
    pub(super) fn tour(&self, indices: &[usize]) -> Option<Tour> {
        let first = match *self.instance.ends() {
            Ends::Closed => 0,
            Ends::OpenFromCosts(_) => indices.iter().position(|&k| Some(k) == self.start)? + 1,
            Ends::OpenFromCluster(start) => {
                indices.iter().position(|&k| self.nodes.get(k).is_some_and(|n| n.0 == start))?
            }
        };
        let mut tour = Tour { clusters: Vec::new(), nodes: Vec::new() };
        for k in 0..indices.len() {
            let index = indices[(first + k) % indices.len()];
            if Some(index) != self.start {
                let &(cluster, node) = self.nodes.get(index)?;
                tour.clusters.push(cluster);
                tour.nodes.push(node);
            }
        }
        Some(tour)
    }
}
