//! The figures of a followed path.

use serde::Serialize;

use crate::verify::Against;

/// Every figure of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FollowFigures {
    /// Poses of the path.
    pub poses: usize,
    /// Its segments.
    pub segments: usize,
    /// Poses that the plan meets.
    pub met: usize,
    /// Where the posture changes within a segment: the tool is lifted, goes through free space and comes
    /// back to the same place, or, where the path cannot be followed, behind that.
    pub reconfigurations: usize,
    /// Ways through free space: those, from segment to segment, and to the first.
    pub transfers: usize,
    /// Euclidean joint movement along the path. \[rad\]
    pub movement_rad: f64,
    /// The least of it over all samples, before it was smoothed, with what transfers take at least: no
    /// other choice of them has fewer reconfigurations, or as many and less movement. \[rad\]
    pub sampled_rad: f64,
    /// The samples: at how many places, and how many joint vectors there in all.
    pub layers: usize,
    /// See [`Self::layers`].
    pub samples: usize,
    /// Sum of all joints' movements, transfers included. \[rad\]
    pub effort_rad: f64,
    /// Duration of the plan. \[s\]
    pub task_time_s: f64,
    /// Farthest that the timed motion passes by any pose, from its knots alone: place, beyond the
    /// tolerance. \[m\]
    pub position_error_max_m: f64,
    /// The same of its axes. \[rad\]
    pub angle_error_max_rad: f64,
    /// How far the tool leaves the straight line between its places at two poses: 90th percentile
    /// over the edges' largest. \[m\]
    pub edge_deviation_p90_m: f64,
    /// The largest. \[m\]
    pub edge_deviation_max_m: f64,
    /// The most that a turning joint moves from a pose to the next along the path. \[rad\]
    pub step_max_rad: f64,
    /// The most that a sliding joint does. \[m\]
    pub step_max_m: f64,
    /// Rules that the plan breaks: limits, times, collisions.
    pub violations: usize,
    /// Calculation until the plan was made, verification apart. \[s\]
    pub calc_time_s: f64,
    /// Verification. \[s\]
    pub verify_time_s: f64,
    /// What the arm was held against.
    pub against: Against,
    /// What was made up for the collision check.
    pub notes: Vec<String>,
}
