//! `planner replan`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use nullsweep_ipc_types::PlanEvent;
use nullsweep_planner::link::publish::{Patience, describe_for};
use nullsweep_planner::link::replan::{Request, Start, replan};
use nullsweep_planner::pipeline::After;
use nullsweep_planner::plan::Plan;

use crate::again::DoneArgs;
use crate::exit::{OK, Usage, VIOLATIONS};
use crate::numbers::seconds;
use crate::output::{say, tell};
use crate::plan::{PlanArgs, make};
use crate::site::SiteArgs;

#[derive(Debug, Args)]
pub(super) struct ReplanArgs {
    /// The plan file that is being executed, or that was stopped: then the arm goes on from where it
    /// stands; or, with --measured or --scan, that ran before.
    #[arg(long, value_name = "PLAN")]
    running: PathBuf,
    /// How long planning may take: the new plan begins in the first knot that is further ahead.
    /// Where planning takes longer, the arm is stopped on its path and planned for from there. Without
    /// it 10 s, at most half of what is left to run, and where that is too short, once more for as long
    /// as planning was found to take. [s]
    #[arg(long, value_name = "S", value_parser = seconds)]
    lead: Option<Duration>,
    /// Where no plan runs, the knot up to which the plan counts as swept; without it the knot in which
    /// the executor has stopped it.
    #[arg(long, value_name = "K", conflicts_with = "lead")]
    from: Option<usize>,
    #[command(flatten)]
    done: DoneArgs,
    #[command(flatten)]
    site: SiteArgs,
    /// Wait for the new plan's end as well.
    #[arg(long)]
    wait: bool,
    /// Seconds to wait for the executor's admission.
    #[arg(long, value_name = "S", default_value = "5", value_parser = seconds)]
    timeout: Duration,
    #[command(flatten)]
    plan: PlanArgs,
}

pub(super) fn run(args: &ReplanArgs) -> anyhow::Result<u8> {
    if args.plan.is_placed() {
        return Err(Usage(
            "where the new plan begins and the robot stands is the running plan's: leave out \
             --continue, --start, --base, --torso and --held"
                .into(),
        )
        .into());
    }
    let running = Plan::read(&args.running)?;
    if args.done.is_asked() {
        return args.done.run(&running, &args.site, &args.plan);
    }
    let end = args.wait.then(|| Duration::from_secs_f64(10.0 * running.duration() + 600.0));
    let patience = Patience { admission: args.timeout, end };
    let site = args.site.site();
    let mut code = OK;
    let mut passed = false;
    let mut from = |start: Start| {
        let late = if passed { "the knot has passed: " } else { "" };
        let (knot, held) = match start {
            Start::Knot(knot) => {
                tell!("{late}planning from knot {knot} on, while the arm goes there");
                passed = true;
                (knot, None)
            }
            Start::Held { knot, at } => {
                tell!("{late}the arm holds past knot {knot}, planning from there");
                (knot, Some(at))
            }
        };
        let after = After { plan: running.clone(), knot, held, again: false };
        let (made, plan) = make(&args.plan, site, Some(after)).map_err(|e| format!("{e:#}"))?;
        code = made;
        if code == VIOLATIONS { Err("it breaks a rule".to_owned()) } else { Ok(plan.sealed()) }
    };
    let request = Request { running: &running, lead: args.lead, from: args.from };
    let mut told = |event: &PlanEvent| {
        tell!("{}", describe_for(event, &running.joints, &running.held));
    };
    let done = replan(site, request, patience, &mut from, &mut told);
    match done {
        Ok(done) => say!("{done}"),
        Err(_) if code == VIOLATIONS => {}
        Err(error) => return Err(error.into()),
    }
    Ok(code)
}
