//! What can go wrong with a program on its way.

use std::path::PathBuf;

use nullsweep_planner::workcell::stance::told;

/// Where in a program something went wrong.
#[derive(Debug, thiserror::Error)]
#[error("{at}")]
pub(super) struct Within {
    pub(super) at: String,
    pub(super) program: PathBuf,
}

/// An arm is not where it may be driven about, or where a plan begins.
#[derive(Debug, thiserror::Error)]
pub(super) enum Astray {
    /// Before a drive.
    #[error("{arm} is not tucked, so the base is not sent anywhere: {}", .joints.join(", "))]
    Drive { arm: String, joints: Vec<String> },
    /// What is around it must be known to bring it on.
    #[error("{arm} was left on its way, and what is around it is not known")]
    Unseen { arm: String },
}

/// The base stands too far off.
#[derive(Debug, thiserror::Error)]
#[error(
    "the base stands at {}, where what is to be swept lies up to {:.1} mm from where the plans have it: at most {:.1} mm",
    told(.stands), 1e3 * .off, 1e3 * .bound
)]
pub(super) struct Off {
    pub(super) stands: [f64; 3],
    pub(super) off: f64,
    pub(super) bound: f64,
}
