//! Why a path is not followed.

use crate::poses::SetupError;
use crate::verify::VerifyError;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum FollowError {
    /// The robot cannot be set up there.
    #[error(transparent)]
    Setup(#[from] SetupError),
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
