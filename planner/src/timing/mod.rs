//! Joint path to timed knots: bang-bang velocity, or time-optimal under limited acceleration.

mod accelerate;
mod bang_bang;
mod jerk;
mod optimal;
mod sampled;
mod smooth;
mod smooth_path;

pub use accelerate::{Rest, accelerate};
pub use bang_bang::{bang_bang, segment_ns, set_times};
pub use sampled::{Timed, timed};
pub use smooth::smooth;
pub use smooth_path::{Piece, SmoothPath};

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
