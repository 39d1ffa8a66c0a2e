//! What a way to a posture is planned by: what is there, how fast, which seed.

use std::path::PathBuf;

use clap::Args;
use nullsweep_collision::Clearance;
use nullsweep_planner::link::Site;
use nullsweep_planner::link::posture::posture;
use nullsweep_planner::plan::{Plan, Profile};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::transit::{self, FARTHEST, Transit, TransitError};
use nullsweep_planner::verify::same_scan;
use nullsweep_planner::workcell::{Scene, Stance};
use nullsweep_robot::{Arm, JointVector, Tool};

use crate::bars::Bars;
use crate::choices::ProfileArg;
use crate::exit::Usage;
use crate::numbers::velocity;
use crate::refusal::tell;
use crate::robot::RobotArgs;
use crate::scene::{Demo, SceneArgs, scene};
use crate::send::LISTEN;

#[derive(Debug, Args)]
pub(super) struct WayArgs {
    /// What is around the arm is a simulated scan.
    #[arg(long, value_enum)]
    demo: Option<Demo>,
    /// Nothing is around the arm but the floor, what a plan is to sweep, and --obstacles.
    #[arg(long, conflicts_with = "demo")]
    empty: bool,
    #[command(flatten)]
    scene: SceneArgs,
    /// One velocity for all joints, where the robot's own limits are higher. [rad/s]
    #[arg(long, value_parser = velocity)]
    v_max: Option<f64>,
    /// How fast the way is gone along.
    #[arg(long, value_enum, default_value = "acceleration")]
    profile: ProfileArg,
    /// Seed of the search; of a simulated scan, or of the points laid on a mesh, where no plan has one.
    #[arg(long)]
    seed: Option<u64>,
}

/// A way that is to be found: where the robot stands, with which tool, and the plan whose scene it is.
pub(super) struct Way<'a> {
    pub(super) robot: &'a RobotArgs,
    pub(super) site: Site<'a>,
    pub(super) scans: &'a [PathBuf],
    pub(super) stance: Stance,
    pub(super) tool: Tool,
    pub(super) plan: Option<&'a Plan>,
    /// Whether whole turns of continuous joints are taken back.
    pub(super) unwinds: bool,
}

impl<'a> Way<'a> {
    /// Where and as a plan has it.
    pub(super) fn of(
        plan: &'a Plan,
        robot: &'a RobotArgs,
        site: Site<'a>,
        scans: &'a [PathBuf],
    ) -> Self {
        let held = plan.held.iter().map(|h| (h.name.clone(), h.position)).collect();
        let stance = Stance { base: plan.base, height: plan.base_height, held };
        let (tool, plan) = (plan.tool.clone(), Some(plan));
        Self { robot, site, scans, stance, tool, plan, unwinds: false }
    }

    /// The arm, its held joints in place.
    pub(super) fn arm(&self) -> anyhow::Result<Arm> {
        Ok(self.stance.bind(&self.robot.arm()?)?)
    }
}

impl WayArgs {
    /// Whether something is said to be around the arm, beside scans.
    pub(super) fn has_demo(&self) -> bool {
        self.demo.is_some()
    }

    /// The verified plan from where the arm is held; none where it is there already.
    ///
    /// # Errors
    /// No way, or nobody who says where the arm is.
    pub(super) fn find(
        &self,
        way: &Way<'_>,
        to: JointVector,
        bars: &Bars,
    ) -> anyhow::Result<Option<Found>> {
        let scene = self.scene(way, bars)?;
        self.find_in(way, &scene, to, bars)
    }

    /// The same in a scene that is known, in the floor frame.
    pub(super) fn find_in(
        &self,
        way: &Way<'_>,
        scene: &Scene,
        to: JointVector,
        bars: &Bars,
    ) -> anyhow::Result<Option<Found>> {
        let arm = way.arm()?;
        let now = posture(way.site, &arm, LISTEN)?;
        now.notes.iter().for_each(|note| bars.note(note));
        let job = Transit {
            arm: way.robot.spec(),
            tool: way.tool.clone(),
            stance: way.stance.clone(),
            from: now.q,
            to,
            unwinds: way.unwinds,
            profile: Profile::from(self.profile),
            v_max: self.v_max,
            collision: way.robot.collision(),
            seed: self.seed.unwrap_or(1),
        };
        let found = transit::run(&way.robot.robot()?, scene, &job, bars);
        bars.clear();
        let found = match found {
            Err(TransitError::Arrived) => return Ok(None),
            found => found?,
        };
        let violations = &found.verification.violations;
        if violations.is_empty() {
            let (plan, clearance) = (found.plan.sealed(), found.clearance);
            return Ok(Some(Found { plan, clearance }));
        }
        tell(violations);
        Err(Broken(violations.len()).into())
    }

    /// What is around the robot at all stops of a program, in the floor frame, where that is said.
    pub(super) fn around(
        &self,
        scans: &[PathBuf],
        seed: u64,
        bars: &Bars,
    ) -> anyhow::Result<Option<Scene>> {
        if self.demo.is_none() && scans.is_empty() {
            return Ok(None);
        }
        scene(&self.scene, self.demo, scans, self.seed.unwrap_or(seed), bars).map(Some)
    }

    /// What is around the arm, in the floor frame.
    fn scene(&self, way: &Way<'_>, bars: &Bars) -> anyhow::Result<Scene> {
        let swept = way.plan.filter(|plan| !plan.surface.is_empty());
        if self.empty && !way.scans.is_empty() {
            return Err(Usage(
                "--empty says that nothing is around the arm: leave it out, or the scans".into(),
            )
            .into());
        }
        if self.empty {
            if way.plan.is_some_and(Plan::is_of_poses) && !self.scene.has_obstacles() {
                bars.note(
                    "a plan of given poses does not say what stood around it: give its --obstacles \
                     again, or they are driven through",
                );
            }
            return self.scene.beside(swept.map_or_else(Scene::empty, surface_of));
        }
        if self.demo.is_none() && way.scans.is_empty() {
            return Err(Usage(
                "what is around the arm? Give the scans (as they were given to `plan`), --demo, or \
                 --empty where nothing is there but the floor, what the plan sweeps, and --obstacles"
                    .into(),
            )
            .into());
        }
        let seed = way.plan.map(|plan| plan.seed).or(self.seed).unwrap_or(1);
        let scene = scene(&self.scene, self.demo, way.scans, seed, bars)?;
        if let Some(plan) = swept {
            same_scan(plan, &scene.surface.transformed(&plan.base_pose().inverse()))?;
        }
        Ok(scene)
    }
}

/// A way that was found and verified.
pub(super) struct Found {
    pub(super) plan: Plan,
    pub(super) clearance: Clearance,
}

impl Found {
    /// How near it comes to what is around it, as a line of an outlook.
    pub(super) fn room(&self) -> String {
        let told = |least: f64| match least {
            least if least >= FARTHEST => format!("over {:.0} mm", 1e3 * FARTHEST),
            least => format!("{:.0} mm", 1e3 * least),
        };
        let (arm, hand) = (told(self.clearance.arm), told(self.clearance.hand));
        format!("  room      {arm} around the arm, {hand} around its hand\n")
    }
}

/// The way breaks a rule.
#[derive(Debug, thiserror::Error)]
#[error("the way breaks {0} rules and is not gone")]
pub(super) struct Broken(usize);

/// The floor, and the surface that a plan sweeps.
fn surface_of(plan: &Plan) -> Scene {
    Scene::on_floor(plan.scan().transformed(&plan.base_pose()))
}
