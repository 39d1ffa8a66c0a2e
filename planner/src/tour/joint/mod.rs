//! The generalised travelling salesman over joint vectors (paper §III.B, Joint-GTSP) at a size
//! that the paper had to leave out: hundreds of nodes in each cluster.
//!
//! Costs between nodes are never stored but for a few nodes of each cluster. [`Layers`] finds the
//! cheapest nodes for a given order over *all* of them, eight costs at a time; [`solve`] finds the
//! order over the few that such a search leaves in question, and takes turns with it.

mod layers;
mod nodes;
mod search;

pub use layers::{Labels, Layers};
pub use nodes::{Cluster, Metric};
pub use search::{JointConfig, JointTour, Problem, adjacent, solve};
