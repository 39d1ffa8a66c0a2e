//! Joint path to timed knots: bang-bang velocity, or as fast as limits of acceleration, or of
//! acceleration and jerk, allow.

mod accelerate;
mod bang_bang;
mod estimate;
mod jerk;
mod optimal;
mod sampled;
mod smooth;
mod smooth_path;
mod speed;

pub use accelerate::{Pace, Rest, accelerate, paced};
pub use bang_bang::{bang_bang, segment_ns, set_times};
pub use estimate::arrivals;
pub use sampled::{Timed, timed};
pub use smooth::smooth;
pub use smooth_path::{Piece, SmoothPath};
pub use speed::Speed;

use nullsweep_robot::{Arm, JointVector};

use crate::cost;

/// What the joints may do. 0 in unused lanes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// \[rad/s\] or \[m/s\]
    pub velocity: JointVector,
    /// \[rad/s²\] or \[m/s²\]
    pub acceleration: JointVector,
}

impl Limits {
    /// The arm's own, with one velocity for all joints where that is lower.
    #[must_use]
    pub fn of(arm: &Arm, v_max: Option<f64>) -> Self {
        let mut limits =
            Self { velocity: cost::velocities(arm, v_max), acceleration: JointVector::default() };
        for (a, joint) in limits.acceleration.iter_mut().zip(arm.limits()) {
            *a = joint.acceleration;
        }
        limits
    }
}

/// Where a joint's jerk limit is not known, it comes to its full acceleration in this time. \[s\]
pub const DEFAULT_JERK_TIME: f64 = 0.1;

/// Each joint's jerk limit: the URDF's, else its acceleration by [`DEFAULT_JERK_TIME`]. \[rad/s³\] or
/// \[m/s³\]
#[must_use]
pub fn jerks(arm: &Arm) -> JointVector {
    let mut jerks = JointVector::ZERO;
    for (jerk, joint) in jerks.iter_mut().zip(arm.limits()) {
        *jerk = joint.jerk.unwrap_or(joint.acceleration / DEFAULT_JERK_TIME);
    }
    jerks
}
