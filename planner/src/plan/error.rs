//! Why a plan file cannot be used.

use std::path::PathBuf;

use nullsweep_ipc_types::{MAX_HELD_JOINTS, MAX_KNOTS};

/// The version of the plan file that this build reads and writes.
pub const FORMAT: u32 = 1;
/// The version of the program file that this build reads and writes.
pub const PROGRAM_FORMAT: u32 = 1;

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
    /// The file holds no text.
    #[error("{path}: not a plan file, which is JSON: it holds no text")]
    NoText {
        /// Which file.
        path: PathBuf,
    },
    /// The file is not a plan.
    #[error("{path}: not a plan file: {source}")]
    Parse {
        /// Which file.
        path: PathBuf,
        /// Line, column and cause.
        source: serde_json::Error,
    },
    /// The file is a program.
    #[error("{path}: a program of several stops, not one plan")]
    IsProgram {
        /// Which file.
        path: PathBuf,
    },
    /// Written by another version.
    #[error("{path}: plan format {found}, this build reads {FORMAT}: plan it again")]
    Format {
        /// Which file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// A program that was written by another version.
    #[error("{path}: program format {found}, this build reads {PROGRAM_FORMAT}: plan it again")]
    ProgramFormat {
        /// Which file.
        path: PathBuf,
        /// Its version.
        found: u32,
    },
    /// A plan of a program was made for another place.
    #[error("plan {work} of stop {stop} was made for another place or other held joints")]
    OtherStop {
        /// Which stop, from 1.
        stop: usize,
        /// Which plan of it, from 1.
        work: usize,
    },
    /// What a stop's program says is done at once cannot be.
    #[error(
        "stop {stop}: what is done together must be pairs of its plans, of two arms, each plan in one pair"
    )]
    NoPair {
        /// Which stop, from 1.
        stop: usize,
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
    /// A number is none, or greater than any joint's.
    #[error("knot {knot}{of}: {value:e} is no place or velocity of a joint: plan it again")]
    NotFinite {
        /// Which knot.
        knot: usize,
        /// Of which path, in words.
        of: &'static str,
        /// What stands there.
        value: f64,
    },
    /// Times do not rise, or go on for longer than the wire takes.
    #[error("knot {knot}{of}: time {time_ns} ns does not come after {before} ns, or too late")]
    TimeOrder {
        /// Which knot.
        knot: usize,
        /// Of which path, in words.
        of: &'static str,
        /// Its time. \[ns\]
        time_ns: u64,
        /// The time of the knot before. \[ns\]
        before: u64,
    },
    /// It would take for ever to go through it.
    #[error(
        "the plan, and what was followed before it, moves joints by {moved:.0} rad in all, at most \
         {most} rad are gone through: plan it again"
    )]
    TooFar {
        /// How far. \[rad\] or \[m\]
        moved: f64,
        /// The most. \[rad\] or \[m\]
        most: f64,
    },
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
