//! `planner plan --stops`: the whole object from several places.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use nullsweep_planner::link::Site;
use nullsweep_planner::plan::Program;
use nullsweep_planner::stops::{self, Setup};
use nullsweep_planner::workcell::Scene;
use nullsweep_report as report;
use nullsweep_robot::{ArmSpec, Robot, Side};

use crate::bars::Bars;
use crate::exit::{OK, Usage};
use crate::json::write_json;
use crate::output::{say, writable};
use crate::picture::of_program as page;
use crate::plan::{Files, PlanArgs};
use crate::program::{figures, table};

#[derive(Debug, Args)]
pub(super) struct StopsArgs {
    /// Sweep the whole object from several places of the robot, and write a program of a plan for each
    /// arm at each: as many stops as are worth it (auto), or at most N.
    #[arg(long, value_name = "auto|N", conflicts_with_all = ["base", "after", "end"])]
    stops: Option<Most>,
    /// With --stops: the arms that work, one after the other at a stop: `left,right`, or BASE,TIP, which
    /// may be repeated. Without it both arms of the PR2, else the arm.
    #[arg(long, value_name = "ARMS", requires = "stops")]
    arms: Vec<Arms>,
    /// With --stops: the two arms work at once at a stop. What both reach is split so that both take as
    /// long, and each waits where the other is in its way.
    #[arg(long, requires = "stops", conflicts_with_all = ["jobs", "job"])]
    together: bool,
    /// With --stops: plan nothing yet, but write a job for each plan of the first stops into this
    /// folder; `planner plan --job` does one, `planner join` puts the program together.
    #[arg(long, value_name = "FOLDER", requires = "stops")]
    jobs: Option<PathBuf>,
    /// Do one such job: its plan goes beside it. Run it in the folder in which the jobs were made.
    #[arg(long, value_name = "FILE", exclusive = true)]
    job: Option<PathBuf>,
}

/// How many stops.
#[derive(Clone, Copy, Debug)]
enum Most {
    Auto,
    Of(usize),
}

impl FromStr for Most {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            _ if text == "auto" => Ok(Self::Auto),
            Ok(n) if (1..=1000).contains(&n) => Ok(Self::Of(n)),
            _ => Err("auto or a number from 1 to 1000 is wanted".into()),
        }
    }
}

/// One arm or more.
#[derive(Clone, Debug)]
struct Arms(Vec<ArmSpec>);

impl FromStr for Arms {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides: Option<Vec<ArmSpec>> = text
            .split(',')
            .map(|side| ["left", "right"].contains(&side).then(|| side.parse().ok()).flatten())
            .collect();
        sides.map_or_else(|| Ok(Self(vec![text.parse()?])), |sides| Ok(Self(sides)))
    }
}

impl StopsArgs {
    /// Where the jobs are to be written.
    pub(super) fn jobs(&self) -> Option<&Path> {
        self.jobs.as_deref()
    }

    /// The job that is to be done.
    pub(super) fn job(&self) -> Option<&Path> {
        self.job.as_deref()
    }

    /// Whether several stops are asked for.
    pub(super) fn is_asked(&self) -> bool {
        self.stops.is_some() || self.job.is_some()
    }

    /// The arms that work.
    fn arms(&self, plan: &PlanArgs) -> anyhow::Result<Vec<ArmSpec>> {
        let mut arms: Vec<ArmSpec> = Vec::new();
        for arm in self.arms.iter().flat_map(|arms| &arms.0) {
            if arms.contains(arm) {
                return Err(Usage(format!("--arms names {arm} twice")).into());
            }
            arms.push(arm.clone());
        }
        if arms.is_empty() && plan.robot.is_pr2() && plan.robot.is_default_arm() {
            return Ok(vec![ArmSpec::pr2(Side::Right), ArmSpec::pr2(Side::Left)]);
        }
        Ok(if arms.is_empty() { vec![plan.robot.spec()] } else { arms })
    }

    /// What is looked for.
    pub(super) fn setup(
        &self,
        plan: &PlanArgs,
        robot: &Robot,
        site: Site<'_>,
        bars: &Bars,
    ) -> anyhow::Result<Setup> {
        let arms = self.arms(plan)?;
        if self.together && arms.len() != 2 {
            let why = format!("--together is for two arms, here are {}: --arms", arms.len());
            return Err(Usage(why).into());
        }
        let job = plan.job(robot, site, None, bars)?;
        if arms.len() > 1 && job.start.is_some() {
            let why = "--start is one arm's: with several arms each begins where it is tucked";
            return Err(Usage(why.into()).into());
        }
        let held = plan.held();
        let lift = stops::lifts(robot, &robot.arm(&job.arm)?, &job)
            .filter(|(lift, _)| held.iter().all(|(name, _)| name != lift));
        let most = match self.stops {
            Some(Most::Of(n)) => Some(n),
            _ => None,
        };
        let tucked = job.start;
        Ok(Setup { job, arms, together: self.together, most, held, lift, tucked, height: 0.0 })
    }
}

/// What stops are looked for in.
pub(super) struct Ground {
    pub(super) robot: Robot,
    pub(super) setup: Setup,
    pub(super) scene: Scene,
}

impl StopsArgs {
    /// What stops are looked for in.
    pub(super) fn ground(
        &self,
        plan: &PlanArgs,
        site: Site<'_>,
        bars: &Bars,
    ) -> anyhow::Result<Ground> {
        let robot = plan.robot.robot()?;
        plan.robot.tell(&robot, bars)?;
        let setup = self.setup(plan, &robot, site, bars)?;
        let scene = plan.scene(bars)?;
        Ok(Ground { robot, setup, scene })
    }
}

/// Makes the program and writes what was asked for.
pub(super) fn run(args: &StopsArgs, plan: &PlanArgs, site: Site<'_>) -> anyhow::Result<u8> {
    let files = plan.files();
    for out in [Some(files.out), files.json, files.report].into_iter().flatten() {
        writable(out)?;
    }
    let bars = Bars::new();
    let ground = args.ground(plan, site, &bars)?;
    let program = stops::run(&ground.robot, &ground.setup, &ground.scene, &bars);
    bars.clear();
    finish(&program?, files, &ground)
}

/// Writes the program and prints what it comes to.
pub(super) fn finish(program: &Program, files: Files<'_>, ground: &Ground) -> anyhow::Result<u8> {
    program.write(files.out)?;
    if let Some(path) = files.report {
        let Ground { robot, setup, scene } = ground;
        report::write(path, &page(program, robot, &setup.job.collision, Some(scene))?)?;
    }
    if let Some(path) = files.json {
        write_json(&figures(program), path)?;
    }
    if files.json != Some(Path::new("-")) {
        say!("{}", table(program));
        say!("program: {}", files.out.display());
        if let Some(path) = files.report {
            say!("report: {}", path.display());
        }
    }
    Ok(OK)
}
