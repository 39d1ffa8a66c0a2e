//! How given poses are met: by which arm, from where, in which scene.

use nullsweep_collision::{CollisionError, Options, World};
use nullsweep_robot::{Arm, ArmError, ArmSpec, JointVector, Robot, Tool};

use super::start::why_not_start;
use super::tolerance::Tolerance;
use crate::timing::Speed;
use crate::workcell::{Scene, Stance};

/// How poses are met, in whatever order.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Base and tip link of the arm.
    pub arm: ArmSpec,
    /// The tool; its contact frame is what meets the poses.
    pub tool: Tool,
    /// How near is met.
    pub tolerance: Tolerance,
    /// Where the robot stands in the scene, and its held joints.
    pub stance: Stance,
    /// Where the arm is; `None`: at the pose that comes first. \[rad\] or \[m\]
    pub start: Option<JointVector>,
    /// How fast the plan goes along its path.
    pub speed: Speed,
    /// Collision margins and meshes.
    pub collision: Options,
    /// Seed of every random choice.
    pub seed: u64,
}

/// Why the robot cannot be set up there.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The arm cannot be used.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// Collisions cannot be checked.
    #[error(transparent)]
    Collision(#[from] CollisionError),
    /// The body stands in something.
    #[error("the robot cannot stand there: {hit}")]
    StanceHit {
        /// What is too near to what.
        hit: String,
    },
    /// The arm cannot be where it is said to be.
    #[error("the arm cannot start where it is: {why}")]
    Start {
        /// The joint beyond its limits, or what is too near to what.
        why: String,
    },
}

/// The robot in its place.
pub(crate) struct Standing {
    pub(crate) arm: Arm,
    /// In the floor frame; all that was measured is in the way.
    pub(crate) scene: Scene,
    pub(crate) world: World,
}

impl Setup {
    /// Puts the robot into a scene in the floor frame.
    pub(crate) fn stand(&self, robot: &Robot, scene: &Scene) -> Result<Standing, SetupError> {
        let arm = self.stance.bind(&robot.arm(&self.arm)?)?;
        let scene = scene.clone().in_the_way();
        let here = scene.transformed(&self.stance.pose().inverse());
        let (points, obstacles) = (here.points(), &here.obstacles);
        let world = World::new(robot, &arm, &self.tool, points, obstacles, &self.collision)?;
        if let Some(hit) = world.stance_hit() {
            return Err(SetupError::StanceHit { hit: hit.to_string() });
        }
        if let Some(why) = self.start.and_then(|q| why_not_start(&arm, &world, &q)) {
            return Err(SetupError::Start { why });
        }
        Ok(Standing { arm, scene, world })
    }
}
