//! Why a plan file cannot be used.

use std::path::PathBuf;

use nullsweep_ipc_types::{MAX_HELD_JOINTS, MAX_KNOTS};

/// The version of the plan file that this build reads and writes.
pub const FORMAT: u32 = 1;

/// Why a plan file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file is not a plan.
    #[error("{path}: not a plan file: {source}")]
    Parse {
        /// Which file.
        path: PathBuf,
        /// Line, column and cause.
        source: serde_json::Error,
    },
    /// Written by another version.
    #[error("{path}: plan format {found}, this build reads {FORMAT}: plan it again")]
    Format {
        /// Which file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// It never passed the last gate.
    #[error("the plan was not verified")]
    Unverified,
    /// A knot is not what was verified.
    #[error("the plan was changed after it was verified: knot {knot}")]
    KnotChanged {
        /// The first such knot.
        knot: usize,
    },
    /// Something else is not what was verified.
    #[error(
        "the plan was changed after it was verified: robot, held joints, tool, place, surface or past"
    )]
    Changed,
    /// More knots than the wire takes.
    #[error("the plan has {found} knots, the wire takes {MAX_KNOTS}")]
    TooLong {
        /// How many.
        found: usize,
    },
    /// More held joints than the wire takes.
    #[error("the robot has {found} other moving joints, the wire takes {MAX_HELD_JOINTS}")]
    TooManyHeld {
        /// How many.
        found: usize,
    },
}
