//! The figures of a plan through given poses.

use serde::Serialize;

use crate::verify::Against;

/// Every figure of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TaskFigures {
    /// Poses of the task.
    pub poses: usize,
    /// Poses that the plan meets.
    pub met: usize,
    /// Euclidean joint movement over all edges that are no reconfiguration: the measure of Wang
    /// and Gleicher. \[rad\]
    pub movement_rad: f64,
    /// Edges that are reconfigurations: a joint moves more than 1 rad, the tool more than 0.2 m or
    /// 0.5 rad, or the middle of the straight joint motion leaves the tool's line by more than
    /// 0.1 m; or that collide and go through free space.
    pub reconfigurations: usize,
    /// Sum of all joints' movements, transfers included. \[rad\]
    pub effort_rad: f64,
    /// Duration of the plan. \[s\]
    pub task_time_s: f64,
    /// Farthest of any pose from being met, beyond its tolerance. \[m\] or \[rad\]
    pub excess_max: f64,
    /// How far the tool leaves the straight line between its places at two poses: 90th percentile
    /// over the edges' largest. \[m\]
    pub edge_deviation_p90_m: f64,
    /// The largest. \[m\]
    pub edge_deviation_max_m: f64,
    /// Rules that the plan breaks: limits, times, collisions.
    pub violations: usize,
    /// Calculation until the route was found, verification apart. \[s\]
    pub calc_time_s: f64,
    /// Verification. \[s\]
    pub verify_time_s: f64,
    /// What the arm was held against.
    pub against: Against,
    /// What was made up for the collision check.
    pub notes: Vec<String>,
}
