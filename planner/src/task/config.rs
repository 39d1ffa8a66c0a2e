//! What is to be planned through given poses.

use nullsweep_collision::Options;
use nullsweep_robot::{ArmSpec, JointVector, Tool};

use crate::poses::Tolerance;
use crate::timing::Speed;
use crate::workcell::Stance;

/// What is to be planned.
#[derive(Clone, Debug)]
pub struct TaskConfig {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool; its contact frame is what meets the poses.
    pub tool: Tool,
    /// How near is met.
    pub tolerance: Tolerance,
    /// Where the robot stands in the scene, and its held joints.
    pub stance: Stance,
    /// Where the arm is; `None`: at the pose that comes first. \[rad\] or \[m\]
    pub start: Option<JointVector>,
    /// How fast the plan goes along its path, at rest in each pose.
    pub speed: Speed,
    /// Collision margins and meshes.
    pub collision: Options,
    /// Rounds of order and relaxation.
    pub rounds: usize,
    /// Trials of the order's search for each pose in each round.
    pub trials: u64,
    /// Seed of every random choice.
    pub seed: u64,
}
