//! What is wrong with a plan.

use serde::{Deserialize, Serialize};

/// What was found wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Violation {
    /// The knot in which the offending segment ends.
    pub knot: usize,
    /// What is wrong.
    pub kind: ViolationKind,
    /// Which joint or which bodies, and by how much.
    pub detail: String,
}

/// The kinds of [`Violation`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ViolationKind {
    /// There are fewer than two knots, or their times do not start at 0 or do not rise.
    TimeOrder,
    /// A value is not finite.
    NotFinite,
    /// A joint is faster than its limit.
    Velocity,
    /// A joint of a plan with limited acceleration speeds up or slows down by more than its limit,
    /// or is not at rest at the start or the end.
    Acceleration,
    /// A joint of a plan with limited jerk changes its acceleration faster than its limit.
    Jerk,
    /// A joint is outside its soft limits with their braking margin at its velocity.
    SoftLimit,
    /// The arm or its tool collides, or the body does where it stands.
    Collision,
    /// The pad touches what it is to keep out of.
    KeepOut,
    /// A tool that works from afar is too near, too far or too aslant.
    StandOff,
    /// A roller is moved sideways.
    Slip,
}
