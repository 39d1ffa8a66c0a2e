//! What is to be planned through given poses.

use crate::poses::Setup;

/// How an order of poses is looked for.
#[derive(Clone, Debug)]
pub struct TaskConfig {
    /// How they are met; with limited acceleration the arm rests in each.
    pub setup: Setup,
    /// Rounds of order and relaxation.
    pub rounds: usize,
    /// Trials of the order's search for each pose in each round.
    pub trials: u64,
}
