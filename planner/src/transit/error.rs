//! Why there is no way from one posture to another.

use std::fmt;

use nullsweep_collision::CollisionError;
use nullsweep_robot::ArmError;

use crate::verify::VerifyError;

/// One of the two ends of a way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Where the arm is.
    Here,
    /// Where it is to go.
    There,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Here => "where the arm is",
            Self::There => "where the arm is to go",
        })
    }
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum TransitError {
    /// The arm cannot be made from the robot.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The collision world cannot be made.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The finished plan cannot be checked.
    #[error("checking the plan: {0}")]
    Verify(#[from] VerifyError),
    /// The body collides where it stands.
    #[error("the robot collides where it stands: {hit}")]
    StanceHit {
        /// With what.
        hit: String,
    },
    /// A joint is outside its limits.
    #[error("{place}, {joint} at {value:.4} is outside its limits {low:.4} … {high:.4}")]
    Limit {
        /// At which end.
        place: Place,
        /// Which joint.
        joint: String,
        /// Where it is. \[rad\] or \[m\]
        value: f64,
        /// Its lower bound. \[rad\] or \[m\]
        low: f64,
        /// Its upper bound. \[rad\] or \[m\]
        high: f64,
    },
    /// The arm collides at one of the ends.
    #[error("{place} it collides: {hit}")]
    Hit {
        /// At which end.
        place: Place,
        /// With what.
        hit: String,
    },
    /// There is nothing to do.
    #[error("the arm is there already")]
    Arrived,
    /// It would touch something as it turns back.
    #[error(
        "{joint} cannot be turned back by {turns} whole turns where the arm is to go: it would touch \
         something on the way; choose a posture with room around the tool"
    )]
    Unwinding {
        /// Which joint.
        joint: String,
        /// By how many turns.
        turns: u32,
    },
    /// None was found.
    #[error("no way free of collision was found between the two postures, in {tries} searches")]
    NoWay {
        /// How often it was looked for.
        tries: u64,
    },
}
