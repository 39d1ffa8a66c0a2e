//! `planner replan`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use nullsweep_ipc_types::PlanEvent;
use nullsweep_planner::link::publish::{Patience, describe};
use nullsweep_planner::link::replan::{Start, replan};
use nullsweep_planner::pipeline::After;
use nullsweep_planner::plan::Plan;

use crate::exit::{OK, Usage, VIOLATIONS};
use crate::numbers::seconds;
use crate::output::{say, tell};
use crate::plan::{PlanArgs, make};
use crate::site::SiteArgs;

#[derive(Debug, Args)]
pub(super) struct ReplanArgs {
    /// The plan file that is being executed.
    #[arg(long, value_name = "PLAN")]
    running: PathBuf,
    /// How long planning may take: the new plan begins in the first knot that is further ahead.
    /// Where planning takes longer, the arm is stopped on its path and planned for from there. [s]
    #[arg(long, value_name = "S", default_value = "10", value_parser = seconds)]
    lead: Duration,
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
    let end = args.wait.then(|| Duration::from_secs_f64(10.0 * running.duration() + 600.0));
    let patience = Patience { admission: args.timeout, end };
    let site = args.site.site();
    let mut code = OK;
    let mut from = |start: Start| {
        let (knot, held) = match start {
            Start::Knot(knot) => {
                tell!("planning from knot {knot} on, at most {} s", args.lead.as_secs_f64());
                (knot, None)
            }
            Start::Held { knot, at } => {
                tell!("the knot has passed: the arm holds past knot {knot}, planning from there");
                (knot, Some(at))
            }
        };
        let after = After { plan: running.clone(), knot, held, again: false };
        let (made, plan) = make(&args.plan, site, Some(after)).map_err(|e| format!("{e:#}"))?;
        code = made;
        if code == VIOLATIONS { Err("it breaks a rule".to_owned()) } else { Ok(plan.sealed()) }
    };
    let done = replan(site, &running, args.lead, patience, &mut from, &mut |event: &PlanEvent| {
        tell!("{}", describe(event));
    });
    match done {
        Ok(done) => say!("{done}"),
        Err(_) if code == VIOLATIONS => {}
        Err(error) => return Err(error.into()),
    }
    Ok(code)
}
