//! Why there are no stops.

use nullsweep_collision::CollisionError;
use nullsweep_robot::ArmError;

use crate::coordinate::CoordinateError;
use crate::pipeline::PipelineError;
use crate::verify::VerifyError;

/// Why there are no stops.
#[derive(Debug, thiserror::Error)]
pub enum StopsError {
    /// An arm cannot be made from the robot.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// A collision world cannot be made.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// A plan cannot be made, for a reason that no other stop mends.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// Two plans cannot be brought onto one clock.
    #[error(transparent)]
    Coordinate(#[from] CoordinateError),
    /// What was made cannot be checked.
    #[error(transparent)]
    Verify(#[from] VerifyError),
    /// So many arms do not work at once.
    #[error("{found} arms are to work at once at a stop: two can")]
    NotTwo {
        /// How many.
        found: usize,
    },
    /// What was begun is of another scene.
    #[error("what was begun was made for another scan, or for other patches of it")]
    OtherScene,
    /// From nowhere anything is reached.
    #[error(
        "none of the {patches} patches is reached from any of {looked} places on the floor that were looked at, of {places} from which the arms are long enough; the tucked posture must be free there too"
    )]
    NothingReached {
        /// How many patches.
        patches: usize,
        /// Places that were looked at.
        looked: usize,
        /// Places that may reach something.
        places: usize,
    },
}
