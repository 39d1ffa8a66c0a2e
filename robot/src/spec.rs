//! What names an arm: its two ends, and where the joints beside it are held.

/// Which part of a robot is the arm: the movable joints between two links.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArmSpec {
    /// Link that carries the arm.
    pub base: String,
    /// Link whose frame is the tip.
    pub tip: String,
}

/// A movable joint of the robot that the arm does not move.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    /// Name of the joint.
    pub name: String,
    /// Where it is held. [rad or m]
    pub position: f64,
}
