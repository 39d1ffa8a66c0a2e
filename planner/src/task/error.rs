//! Why there is no plan through given poses.

use nullsweep_gtsp::{InstanceError, SolveError};

use crate::poses::SetupError;
use crate::verify::VerifyError;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum TaskError {
    /// The robot cannot be set up there.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// No way leads from the start to any pose.
    #[error(
        "no motion through free space was found from the start to any of the {met} poses that the arm meets"
    )]
    NoWay {
        /// How many there are.
        met: usize,
    },
    /// No joint vector was found for any pose.
    #[error(
        "none of the {poses} poses is met by the arm inside its limits and free of collision: are \
         they in the robot's root frame, and is the tip link right?"
    )]
    NothingMet {
        /// How many there are.
        poses: usize,
    },
    /// The finished plan cannot be checked.
    #[error("checking the plan: {0}")]
    Verify(#[from] VerifyError),
    /// The order's search.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The order's search.
    #[error(transparent)]
    Solve(#[from] SolveError),
}
