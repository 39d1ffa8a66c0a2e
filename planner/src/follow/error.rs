//! Why a path is not followed.

use nullsweep_collision::CollisionError;
use nullsweep_robot::ArmError;

use crate::verify::VerifyError;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum FollowError {
    /// The arm cannot be used.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// Collisions cannot be checked.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The body stands in something.
    #[error("the robot cannot stand there: {hit}")]
    StanceHit {
        /// What is too near to what.
        hit: String,
    },
    /// The arm cannot be where it is said to be.
    #[error("the arm cannot start where it is: {why}")]
    Start {
        /// The joint beyond its limits, or what is too near to what.
        why: String,
    },
    /// No joint vector was found for any pose.
    #[error(
        "none of the {poses} poses is met: {why}; are they in the robot's root frame, and is the tip \
         link right?"
    )]
    NothingMet {
        /// How many there are.
        poses: usize,
        /// Why the first is not.
        why: String,
    },
    /// No way leads to the path.
    #[error(
        "no motion through free space was found from the start to any of the {met} poses that the arm \
         meets"
    )]
    NoWay {
        /// How many there are.
        met: usize,
    },
    /// The finished plan cannot be checked.
    #[error("checking the plan: {0}")]
    Verify(#[from] VerifyError),
}
