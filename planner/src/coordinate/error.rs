//! Why two plans cannot be brought onto one clock.

use nullsweep_collision::CollisionError;
use nullsweep_robot::ArmError;

/// Why two plans cannot be brought onto one clock.
#[derive(Debug, thiserror::Error)]
pub enum CoordinateError {
    /// An arm cannot be made from the robot.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// A collision world cannot be made.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// A joint moves links of both arms.
    #[error("{first} and {second} both move {link}: arms that work at once share none")]
    Shared {
        /// One arm.
        first: String,
        /// The other one.
        second: String,
        /// A link that both move.
        link: String,
    },
}
