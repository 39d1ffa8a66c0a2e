//! A tour, its validity and its cost, recomputed from the instance alone.

use crate::instance::{Ends, Instance};

/// A visiting order of the clusters with the node chosen in each.
///
/// Open paths list the clusters from the first visited to the last; a closed tour may begin
/// anywhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tour {
    /// Cluster indices in visiting order.
    pub clusters: Vec<usize>,
    /// `nodes[k]`: node chosen in `clusters[k]`, counted within that cluster.
    pub nodes: Vec<usize>,
}

/// What a tour costs, in the unit of the instance's costs; jumps are counted apart from the arcs.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct TourCost {
    /// Sum of the arcs that are no jumps.
    pub finite: f64,
    /// Number of jumps.
    pub jumps: usize,
    /// Sum of the jump prices; `+inf` where jumps are forbidden and there is one.
    pub jump_cost: f64,
}

impl TourCost {
    /// The objective: arcs and jumps together.
    pub fn total(&self) -> f64 {
        self.finite + self.jump_cost
    }

    /// Whether this cost is lower: by the total, where both are infinite by jumps and then by arcs.
    pub fn better_than(&self, other: &Self) -> bool {
        if self.total() == f64::INFINITY && other.total() == f64::INFINITY {
            return (self.jumps, self.finite) < (other.jumps, other.finite);
        }
        self.total() < other.total()
    }

    fn add(&mut self, arc: Option<f64>, price: impl FnOnce() -> f64) {
        match arc {
            Some(cost) => self.finite += cost,
            None => {
                self.jumps += 1;
                self.jump_cost += price();
            }
        }
    }
}

/// Why a tour does not fit an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TourError {
    /// Wrong number of entries.
    #[error("the tour visits {clusters} clusters at {nodes} nodes, expected {expected} of each")]
    Length {
        /// Clusters listed.
        clusters: usize,
        /// Nodes listed.
        nodes: usize,
        /// Clusters of the instance.
        expected: usize,
    },
    /// An index out of range.
    #[error("position {position}: cluster {cluster}, node {node} does not exist")]
    Index {
        /// Place in the tour.
        position: usize,
        /// Cluster there.
        cluster: usize,
        /// Node there.
        node: usize,
    },
    /// A cluster occurs twice, so another is missing.
    #[error("cluster {cluster} is visited twice")]
    Twice {
        /// The cluster.
        cluster: usize,
    },
    /// An open path begins elsewhere.
    #[error("the path begins in cluster {found}, but its start is cluster {start}")]
    Start {
        /// First cluster of the tour.
        found: usize,
        /// Start cluster of the instance.
        start: usize,
    },
}

impl Tour {
    /// Checks that every cluster is visited once at a node of its own, from the right start.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn check(&self, instance: &Instance) -> Result<(), TourError> {
        let m = instance.clusters();
        if self.clusters.len() != m || self.nodes.len() != m {
            return Err(TourError::Length {
                clusters: self.clusters.len(),
                nodes: self.nodes.len(),
                expected: m,
            });
        }
        let mut seen = vec![false; m];
        for (position, (&cluster, &node)) in self.clusters.iter().zip(&self.nodes).enumerate() {
            if cluster >= m || node >= instance.sizes()[cluster] {
                return Err(TourError::Index { position, cluster, node });
            }
            if std::mem::replace(&mut seen[cluster], true) {
                return Err(TourError::Twice { cluster });
            }
        }
        match *instance.ends() {
            Ends::OpenFromCluster(start) if self.clusters[0] != start => {
                Err(TourError::Start { found: self.clusters[0], start })
            }
            _ => Ok(()),
        }
    }

    /// Cost of the tour, arc by arc from the instance.
    ///
    /// # Panics
    /// May panic on a tour that [`Tour::check`] rejects.
    pub fn cost(&self, instance: &Instance) -> TourCost {
        let mut cost = TourCost::default();
        let m = self.clusters.len();
        let at = |k: usize| (self.clusters[k], self.nodes[k]);
        if let Ends::OpenFromCosts(start) = instance.ends() {
            let (b, j) = at(0);
            let arc = start[instance.node_index(b, j)];
            cost.add(arc.is_finite().then_some(arc), || instance.start_jump_price());
        }
        let arcs = if *instance.ends() == Ends::Closed && m > 1 { m } else { m - 1 };
        for k in 0..arcs {
            let ((a, i), (b, j)) = (at(k), at((k + 1) % m));
            cost.add(instance.arc(a, i, b, j), || instance.jump_price(a, b));
        }
        cost
    }
}
