//! What `planner publish` takes of a program, and the program's arms.

use std::path::{Path, PathBuf};

use clap::Args;
use nullsweep_planner::link::{Post, Site};
use nullsweep_planner::plan::Plan;
use nullsweep_robot::{Arm, ArmSpec, Robot};

use crate::exit::Usage;
use crate::numbers::not_negative;
use crate::robot::RobotArgs;
use crate::send::SendArgs;
use crate::site::SiteArgs;
use crate::way::WayArgs;

#[derive(Debug, Args)]
pub(super) struct ProgramArgs {
    /// Of a program: go on where its journal says that it was left. With the scans, given as they were to
    /// `plan`, a plan that was left on its way is planned anew for what it has left.
    #[arg(long, group = "seen")]
    pub(super) resume: bool,
    /// Of a program: the robot's name in the service names of an arm's executor, ARM as in --arms; may be
    /// repeated. Without it that of --robot-name, which is also the base's, where the program has one arm.
    #[arg(long, value_name = "ARM=NAME")]
    pub(super) executor: Vec<Post>,
    /// Of a program: where it is kept what is done; without it PROGRAM.journal.
    #[arg(long, value_name = "FILE")]
    pub(super) journal: Option<PathBuf>,
    /// Of a program: how far what is to be swept may lie from where a plan has it, because the base stands
    /// off its place: plans keep 5 mm clear. [m]
    #[arg(long, value_name = "M", default_value_t = 0.005, value_parser = not_negative)]
    pub(super) base_off: f64,
    /// Of a program: write what was done as JSON to a file.
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

impl ProgramArgs {
    /// Refuses what says something of programs alone, of a plan.
    pub(super) fn of_a_plan(&self) -> Result<(), Usage> {
        let is_said = self.resume
            || !self.executor.is_empty()
            || self.journal.is_some()
            || self.json.is_some();
        if is_said {
            return Err(Usage(
                "--resume, --executor, --journal and --json are for programs, of `planner plan --stops`: \
                 `planner replan` goes on with a plan"
                    .into(),
            ));
        }
        Ok(())
    }
}

/// All that was said of how a program is to be worked through.
#[derive(Clone, Copy)]
pub(super) struct Asked<'a> {
    pub(super) file: &'a Path,
    pub(super) scans: &'a [PathBuf],
    pub(super) unverified: bool,
    pub(super) program: &'a ProgramArgs,
    pub(super) send: &'a SendArgs,
    pub(super) site: &'a SiteArgs,
    pub(super) robot: &'a RobotArgs,
    pub(super) way: &'a WayArgs,
}

/// An arm of the program, and where its executor is.
#[derive(Clone, Debug)]
pub(super) struct Limb {
    pub(super) spec: ArmSpec,
    /// The robot's name in its executor's service names.
    pub(super) name: String,
}

impl Limb {
    /// Where its executor is.
    pub(super) fn site<'a>(&'a self, asked: Asked<'a>) -> Site<'a> {
        Site { robot: &self.name, root: asked.site.site().root }
    }
}

/// An arm, its held joints where a plan has them.
pub(super) fn arm_of(robot: &Robot, spec: &ArmSpec, plan: &Plan) -> anyhow::Result<Arm> {
    let held: Vec<_> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    Ok(robot.arm(spec)?.with_held(&held)?)
}
