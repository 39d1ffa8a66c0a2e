//! Why there is no plan.

use nullsweep_collision::CollisionError;
use nullsweep_robot::ArmError;

use crate::plan::PlanError;
use crate::tour::formulation::FormulationError;
use crate::verify::VerifyError;
use crate::workcell::stance::told;

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The arm cannot be made from the robot.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// No order was found.
    #[error(transparent)]
    Formulation(#[from] FormulationError),
    /// The collision world cannot be made.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The plan to go on from cannot be named.
    #[error("the plan to go on from: {0}")]
    Plan(#[from] PlanError),
    /// The finished plan cannot be checked.
    #[error("checking the plan: {0}")]
    Verify(#[from] VerifyError),
    /// A nozzle at bang-bang velocity.
    #[error(
        "{tool} lays on by its speed, and at bang-bang velocity the joints alone say how fast it goes"
    )]
    NoSpeed {
        /// The tool.
        tool: String,
    },
    /// No patch was found.
    #[error("no locally planar patch among {points} points: are they in metres?")]
    NoPatches {
        /// How many points.
        points: usize,
    },
    /// Nothing is this plan's.
    #[error("every patch is swept before or left to others: nothing is left to plan")]
    AllSpared,
    /// No stance reaches anything.
    #[error(
        "no stance of {tried} reaches any of the {patches} patches; where most seemed in reach: {why}"
    )]
    NoStance {
        /// Stances tried with an exact look.
        tried: usize,
        /// How many patches.
        patches: usize,
        /// What is in the way.
        why: String,
    },
    /// The body collides where it stands.
    #[error("the robot collides where it stands: {hit}")]
    StanceHit {
        /// With what.
        hit: String,
    },
    /// The arm collides where it starts.
    #[error("the arm collides in its start posture: {hit}")]
    StartHit {
        /// With what.
        hit: String,
    },
    /// The start is outside the limits.
    #[error(
        "the start posture leaves the margined soft limits: {joint} at {value:.4}, limits {low:.4} … {high:.4}"
    )]
    StartLimit {
        /// Which joint.
        joint: String,
        /// Where it is.
        value: f64,
        /// Its lower bound.
        low: f64,
        /// Its upper bound.
        high: f64,
    },
    /// No patch can be reached.
    #[error("none of the {patches} patches can be reached from base {}: {why}", told(.base))]
    NothingReached {
        /// How many patches.
        patches: usize,
        /// The stance.
        base: [f64; 3],
        /// What is in the way.
        why: String,
    },
    /// No motion to any patch was found.
    #[error(
        "no motion from the start posture to any of the {reachable} reachable patches was found"
    )]
    NoMotion {
        /// How many patches are reachable.
        reachable: usize,
    },
    /// The plan to go on from has swept everything.
    #[error("every reachable patch is swept by knot {knot}: nothing is left to plan")]
    NothingLeft {
        /// The knot to go on from.
        knot: usize,
    },
    /// The knot to go on from does not exist.
    #[error("the plan to continue has {knots} knots, there is no knot {knot}")]
    NoSuchKnot {
        /// How many knots.
        knots: usize,
        /// Which was asked for.
        knot: usize,
    },
}
