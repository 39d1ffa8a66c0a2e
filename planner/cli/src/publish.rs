//! `planner publish`.

use std::path::PathBuf;

use clap::{Arg, Args, Command};
use nullsweep_ipc_types::Reason;
use nullsweep_planner::link::publish::{Join, PublishError};
use nullsweep_planner::plan::{Plan, PlanError, Program};
use nullsweep_robot::Arm;

use crate::bars::Bars;
use crate::choices::JoinArg;
use crate::exit::{OK, Usage, VIOLATIONS};
use crate::output::{complain, say, say_on};
use crate::program_args::{Asked, ProgramArgs};
use crate::publish_program;
use crate::robot::{RobotArgs, differs};
use crate::send::{SendArgs, interruption, outlook, resting};
use crate::site::SiteArgs;
use crate::way::{Broken, Found, Way, WayArgs};

#[derive(Debug, Args)]
#[command(mut_args(only_with_goto))]
pub(super) struct PublishArgs {
    /// The plan file, or the program of `planner plan --stops`.
    plan: PathBuf,
    /// With --goto or --resume: the scans that the plan was made for, given as they were to `plan`.
    #[arg(requires = SEEN)]
    scans: Vec<PathBuf>,
    /// Bring the arm to the plan's start first, free of collision, as `planner goto` does.
    #[arg(long, group = SEEN)]
    goto: bool,
    /// How it joins what is going on; without it at its knot for a plan that continues another
    /// one, else after a stop.
    #[arg(long, value_enum)]
    join: Option<JoinArg>,
    /// Wait for the plan's end as well, and show how far it is.
    #[arg(long)]
    wait: bool,
    /// Send a plan that was not verified, or that was changed since.
    #[arg(long)]
    unverified: bool,
    #[command(flatten)]
    send: SendArgs,
    #[command(flatten)]
    site: SiteArgs,
    #[command(flatten, next_help_heading = "Of a program")]
    program: ProgramArgs,
    #[command(
        flatten,
        next_help_heading = "The robot, and what is around it with --goto or --resume"
    )]
    robot: RobotArgs,
    #[command(flatten)]
    way: WayArgs,
}

pub(super) fn run(args: &PublishArgs) -> anyhow::Result<u8> {
    match Program::read(&args.plan) {
        Ok(Some(program)) => return publish_program::run(args.of_program()?, &program),
        // A plan's reader says more of a file that is none.
        Ok(None) | Err(PlanError::File { .. }) => {}
        Err(error) => return Err(error.into()),
    }
    args.program.of_a_plan()?;
    let plan = Plan::read(&args.plan)?;
    match plan.check_seal() {
        Err(error) if args.unverified => complain!("planner: warning: {error}; it is sent anyway"),
        checked => checked?,
    }
    let natural = if plan.continues.is_some() { Join::Knot } else { Join::Stop };
    let join = args.join.map_or(natural, Join::from);
    if args.goto && join != Join::Stop {
        return Err(Usage(
            "with --goto the arm comes to rest at the plan's start, and a plan that goes on from a \
             knot of another one, or after it, joins it in motion: leave out --goto, or give --join \
             stop to run it alone"
                .into(),
        )
        .into());
    }
    let site = args.site.site();
    let arm = args.arm_of(&plan);
    let first = match args.way_to(&plan) {
        Err(error) if error.is::<Broken>() => {
            complain!("planner: {error}");
            return Ok(VIOLATIONS);
        }
        first => first?,
    };
    let now = arm.as_ref().filter(|_| join == Join::Stop).and_then(|arm| resting(site, arm));
    if let Some(first) = &first {
        say!("to the plan's start:");
        say_on!("{}{}", outlook(&first.plan, arm.as_ref(), now.as_ref()), first.room());
    }
    say!("{}:", args.plan.display());
    let now = now.filter(|_| first.is_none());
    say_on!("{}", outlook(&plan, arm.as_ref(), now.as_ref()));
    if let (Some(arm), None, true) = (&arm, &now, first.is_none() && join == Join::Stop) {
        say_on!("{}", interruption(site, arm));
    }
    args.send.confirm()?;
    if let Some(first) = &first {
        args.send.send((&first.plan, None), arm.as_ref(), site, Join::Stop, true)?;
    }
    let sent = args.send.send((&plan, Some(&args.plan)), arm.as_ref(), site, join, args.wait);
    sent.map_err(|error| args.other_robot(&plan, error))?;
    Ok(OK)
}

/// Flags by which it matters what is around the arm.
const SEEN: &str = "seen";

/// What says how the way to the start is planned says nothing without one.
fn only_with_goto(arg: Arg) -> Arg {
    let way = WayArgs::augment_args(Command::new("way"));
    let is_ways = way.get_arguments().any(|of_way| of_way.get_id() == arg.get_id());
    if is_ways { arg.requires(SEEN) } else { arg }
}

impl PublishArgs {
    /// What they say of a program.
    fn of_program(&self) -> Result<Asked<'_>, Usage> {
        if self.join.is_some() {
            return Err(Usage("--join is for plans: those of a program begin at rest".into()));
        }
        let Self { plan, scans, unverified, program, send, site, robot, way, .. } = self;
        Ok(Asked { file: plan, scans, unverified: *unverified, program, send, site, robot, way })
    }

    /// The plan's arm, where the arguments name it: who sends a plan need not say which robot it is of.
    fn arm_of(&self, plan: &Plan) -> Option<Arm> {
        let held: Vec<_> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
        let arm = self.robot.arm().ok()?.with_held(&held).ok()?;
        (arm.fingerprint() == plan.fingerprint).then_some(arm)
    }

    /// Where the executor's robot is another one than the plan's, the error that says in what, as far as
    /// that is known here.
    fn other_robot(&self, plan: &Plan, error: anyhow::Error) -> anyhow::Error {
        let rejected = error.downcast_ref().is_some_and(|error| {
            matches!(error, PublishError::Rejected(why) if why.reason == Reason::Robot.wire())
        });
        let Some(arm) = self.robot.arm().ok().filter(|_| rejected) else { return error };
        if arm.fingerprint() == plan.fingerprint {
            return error.context(format!(
                "the plan's robot is the one that is given here, {} with {} joints: it is the executor \
                 that was started for another one, by --cell, --urdf or --arm",
                plan.robot,
                plan.joints.len()
            ));
        }
        error.context(differs(plan, &arm))
    }

    /// The way to the plan's start, where one was asked for and is needed.
    fn way_to(&self, plan: &Plan) -> anyhow::Result<Option<Found>> {
        let Some(first) = plan.knots.first().filter(|_| self.goto) else { return Ok(None) };
        let way = Way::of(plan, &self.robot, self.site.site(), &self.scans);
        self.way.find(&way, first.q, &Bars::new())
    }
}
