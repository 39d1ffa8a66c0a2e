//! What is to be followed, and how.

use nullsweep_collision::Options;
use nullsweep_robot::{ArmSpec, JointVector, Tool};

use crate::poses::Tolerance;
use crate::timing::Speed;
use crate::workcell::Stance;

/// How a path is to be followed.
#[derive(Clone, Debug)]
pub struct FollowConfig {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool; its contact frame follows the path.
    pub tool: Tool,
    /// How near is met.
    pub tolerance: Tolerance,
    /// Where the robot stands in the scene, and its held joints.
    pub stance: Stance,
    /// Where the arm is; `None`: at the first pose. \[rad\] or \[m\]
    pub start: Option<JointVector>,
    /// How fast the plan goes along its path.
    pub speed: Speed,
    /// The most that a turning and a sliding joint may move from a place of the path to the next, which
    /// are at most 1 cm and 0.05 rad apart. \[rad\], \[m\]
    pub step: [f64; 2],
    /// Collision margins and meshes.
    pub collision: Options,
    /// Seed of every random choice.
    pub seed: u64,
}

impl FollowConfig {
    /// What counts as following and not as jumping, unless it is said: 7° and 2 cm.
    pub const STEP: [f64; 2] = [0.12, 0.02];
}
