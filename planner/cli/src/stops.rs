//! `planner plan --stops`: the whole object from several places.

use std::path::Path;
use std::str::FromStr;

use clap::Args;
use nullsweep_planner::link::Site;
use nullsweep_planner::pipeline::StanceChoice;
use nullsweep_planner::plan::Program;
use nullsweep_planner::progress::Progress;
use nullsweep_planner::stops::{self, Setup};
use nullsweep_planner::workcell::Scene;
use nullsweep_robot::{ArmSpec, Robot, Side};

use crate::bars::Bars;
use crate::exit::{OK, Usage};
use crate::json::write_json;
use crate::output::{say, writable};
use crate::plan::PlanArgs;
use crate::program::table;

#[derive(Debug, Args)]
pub(super) struct StopsArgs {
    /// Sweep the whole object from several places of the robot, and write a program of a plan for each
    /// arm at each: as many stops as are worth it (auto), or at most N.
    #[arg(long, value_name = "auto|N", conflicts_with_all = ["base", "after", "end", "report"])]
    stops: Option<Most>,
    /// With --stops: the arms that work, one after the other at a stop: `left,right`, or BASE,TIP, which
    /// may be repeated. Without it both arms of the PR2, else the arm.
    #[arg(long, value_name = "ARMS", requires = "stops")]
    arms: Vec<Arms>,
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
    /// Whether several stops are asked for.
    pub(super) fn is_asked(&self) -> bool {
        self.stops.is_some()
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
        let job = plan.job(robot, site, None, bars)?;
        if arms.len() > 1 && job.start.is_some() {
            let why = "--start is one arm's: with several arms each begins where it is tucked";
            return Err(Usage(why.into()).into());
        }
        let (held, lift) = match &job.stance {
            StanceChoice::Search(search) => (search.held.clone(), search.lift.clone()),
            _ => (Vec::new(), None),
        };
        let most = match self.stops {
            Some(Most::Of(n)) => Some(n),
            _ => None,
        };
        let tucked = job.start;
        Ok(Setup { job, arms, most, held, lift, tucked, height: 0.0 })
    }
}

/// Makes the program and writes what was asked for.
pub(super) fn run(args: &StopsArgs, plan: &PlanArgs, site: Site<'_>) -> anyhow::Result<u8> {
    for out in [Some(plan.out()), plan.json()].into_iter().flatten() {
        writable(out)?;
    }
    let bars = Bars::new();
    let robot = plan.robot.robot()?;
    plan.robot.tell(&robot, &bars)?;
    let setup = args.setup(plan, &robot, site, &bars)?;
    let scene = plan.scene(&bars)?;
    let program = make(&robot, &setup, &scene, &bars);
    bars.clear();
    finish(&program?, plan.out(), plan.json())
}

fn make(robot: &Robot, setup: &Setup, scene: &Scene, bars: &Bars) -> anyhow::Result<Program> {
    Ok(stops::run(robot, setup, scene, bars)?)
}

/// Writes the program and prints what it comes to.
pub(super) fn finish(program: &Program, out: &Path, json: Option<&Path>) -> anyhow::Result<u8> {
    program.write(out)?;
    if let Some(path) = json {
        write_json(&crate::program::figures(program), path)?;
    }
    if json != Some(Path::new("-")) {
        say!("{}", table(program));
        say!("program: {}", out.display());
    }
    Ok(OK)
}
