//! What is to be planned through given poses.

use nalgebra::{Isometry3, Vector3};
use nullsweep_collision::Options;
use nullsweep_robot::{ArmSpec, JointVector, Tool};

use super::tolerance::Tolerance;
use crate::plan::Profile;
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
    /// How fast the plan goes along its path.
    pub profile: Profile,
    /// Collision margins and meshes.
    pub collision: Options,
    /// One velocity for all joints; `None`: the robot's limits. \[rad/s\]
    pub v_max: Option<f64>,
    /// Rounds of order and relaxation.
    pub rounds: usize,
    /// Trials of the order's search for each pose in each round.
    pub trials: u64,
    /// Seed of every random choice.
    pub seed: u64,
}

/// The floor where nothing is said of it, in the robot's root frame: z = 0, or so far under the tool
/// at the lowest pose that it keeps its margin. \[m\]
#[must_use]
pub fn floor_under(poses: &[Isometry3<f64>], tool: &Tool, margin: f64) -> f64 {
    let half = Vector3::new(0.5 * tool.width, 0.5 * tool.length, 0.0);
    let lowest = |pose: &Isometry3<f64>| {
        let down = pose.rotation.inverse_transform_vector(&-Vector3::z());
        let front = pose.translation.vector.z - down.abs().dot(&half);
        // The pad's back lies its thickness behind its plane, against z.
        front - (tool.thickness * -down.z).max(0.0)
    };
    poses.iter().map(lowest).fold(0.0, |floor, lowest| floor.min(lowest - FLOOR_SLACK - margin))
}

/// What a tool may be lower than its pose asks, by the tolerance of the pose. \[m\]
const FLOOR_SLACK: f64 = 0.001;

/// A tool for poses that speak of the tip frame itself: a cube of 1 cm behind its origin, z ahead.
#[must_use]
pub fn tip_tool() -> Tool {
    Tool {
        name: "tip".into(),
        length: 0.01,
        width: 0.01,
        thickness: 0.01,
        centre: [0.0; 3],
        approach: [0.0, 0.0, 1.0],
        across: [0.0, 1.0, 0.0],
        symmetric: false,
        ..Tool::default()
    }
}
