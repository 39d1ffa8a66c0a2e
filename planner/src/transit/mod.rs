//! From where the arm is to a posture, through free space: what brings it to a plan's start, and home
//! again.

mod error;
mod run;

pub use error::{Place, TransitError};
pub use run::{FARTHEST, Transit, TransitOutcome, run};
