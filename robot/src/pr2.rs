//! The PR2: our own URDF of it, its two arms and its postures.

use crate::spec::ArmSpec;
use crate::urdf::Robot;

/// An arm of the PR2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The left arm, at y = +0.188 m.
    Left,
    /// The right arm, at y = −0.188 m.
    Right,
}

impl Robot {
    /// The PR2 as this project describes it: kinematics and limits of the real robot, collision
    /// shapes from boxes, cylinders and spheres, both grippers closed, only the torso and the two
    /// arms movable.
    #[must_use]
    pub fn pr2() -> Self {
        Self::from_urdf_str(include_str!("../pr2.urdf"))
            .expect("pr2.urdf is part of this crate and tested")
    }
}

impl ArmSpec {
    /// An arm of the PR2, from the torso to the gripper's tool frame.
    #[must_use]
    pub fn pr2(side: Side) -> Self {
        let letter = match side {
            Side::Left => 'l',
            Side::Right => 'r',
        };
        Self { base: "torso_lift_link".into(), tip: format!("{letter}_gripper_tool_frame") }
    }
}

/// A posture of the PR2's right arm; the left arm's mirrors pan, rolls and wrist roll. \[rad\]
struct Posture([f64; 7]);

/// Ready to work in front of the robot.
const READY: Posture = Posture([-0.6, -0.03, -1.2, -1.6, -2.2, -1.45, 0.0]);
/// Out of the way at the robot's side.
const ASIDE: Posture = Posture([-1.4, 0.9, -0.6, -1.9, 0.0, -0.8, 0.0]);

const JOINTS: [(&str, f64); 7] = [
    ("shoulder_pan_joint", -1.0),
    ("shoulder_lift_joint", 1.0),
    ("upper_arm_roll_joint", -1.0),
    ("elbow_flex_joint", 1.0),
    ("forearm_roll_joint", -1.0),
    ("wrist_flex_joint", 1.0),
    ("wrist_roll_joint", -1.0),
];

/// The ready position of a joint of the PR2's arms, by name. \[rad\]
pub(crate) fn ready(joint: &str) -> Option<f64> {
    READY.of(joint)
}

/// Where a joint of the PR2's arms is held by default while another arm works. \[rad\]
pub(crate) fn aside(joint: &str) -> Option<f64> {
    ASIDE.of(joint)
}

impl Posture {
    fn of(&self, joint: &str) -> Option<f64> {
        let (side, name) = joint.split_once('_')?;
        let index = JOINTS.iter().position(|(n, _)| *n == name)?;
        match side {
            "r" => Some(self.0[index]),
            "l" => Some(self.0[index] * JOINTS[index].1),
            _ => None,
        }
    }
}
