#![doc = include_str!("../README.md")]

mod adjacency;
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
mod pairs;
mod pieces;
mod population;
mod quantiser;
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

pub use bound::{Effort, lower_bound};
pub use exact::solve as solve_exact;
pub use instance::{Block, CostFn, Costs, Ends, Instance, InstanceError, Jump, OnDemand};
pub use record::{Observer, Progress};
pub use solve::{Budget, Control, Solution, SolveError, solve, solve_with};
pub use tour::{Tour, TourCost, TourError};
pub use transform::{Transformed, solve_transformed, transform};
