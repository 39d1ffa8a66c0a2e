//! Generalized travelling salesman: visit every cluster once, at one node of each, at least cost.
//!
//! The module knows nothing of robots. An [`Instance`] is clusters with node counts, costs
//! ([`Costs`]: dense, sparse blocks between adjacent clusters, or on demand), the price of a jump
//! where there is no arc ([`Jump`]: forbidden, uniform, or a table of cluster pairs) and the tour's
//! ends ([`Ends`]: closed, open from start costs, open from a start cluster). [`solve`] returns the
//! best [`Tour`] found within a [`Budget`], with its [`TourCost`]: finite cost and jumps apart.
//!
//! ```
//! use nullsweep_gtsp::{Block, Budget, Costs, Ends, Instance, Jump, solve};
//!
//! // Three clusters of 2, 1 and 2 nodes; 0–1 and 1–2 are adjacent, 0–2 is not.
//! let mut blocks = Vec::new();
//! blocks.extend(Block::both_ways(0, 1, 2, vec![4.0, 1.0]));
//! blocks.extend(Block::both_ways(1, 2, 1, vec![f64::INFINITY, 2.0]));
//! let start = vec![0.0, 0.5, 9.0, 9.0, 9.0];
//! let instance =
//!     Instance::new(&[2, 1, 2], Costs::Blocks(blocks), Jump::Uniform(100.0), Ends::OpenFromCosts(start))?;
//! let solution = solve(&instance, &Budget::trials(1000), 1)?;
//! assert_eq!(solution.tour.clusters, [0, 1, 2]);
//! assert_eq!(solution.tour.nodes, [1, 0, 1]);
//! assert_eq!((solution.cost.finite, solution.cost.jumps), (3.5, 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod atsp;
mod bound;
mod candidate_nodes;
mod closed;
mod cluster_optimisation;
mod eax;
mod exact;
mod ils;
mod instance;
mod local;
mod moves;
mod population;
mod reconnection;
mod record;
mod rooted;
mod search_tour;
mod solve;
mod table;
#[cfg(test)]
mod tests;
mod tour;
mod transform;
pub mod tsplib;

pub use bound::lower_bound;
pub use exact::solve as solve_exact;
pub use instance::{Block, CostFn, Costs, Ends, Instance, InstanceError, Jump, OnDemand, Weight};
pub use record::{Observer, Progress};
pub use solve::{Budget, Control, Solution, SolveError, solve, solve_with};
pub use tour::{Tour, TourCost, TourError};
pub use transform::{Transformed, solve_transformed, transform};
