//! `planner publish`.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use nullsweep_ipc_types::service::DEFAULT_ROBOT;
use nullsweep_planner::link::publish::{Join, Patience, describe, publish};
use nullsweep_planner::plan::Plan;

use crate::choices::JoinArg;
use crate::exit::OK;
use crate::numbers::seconds;

#[derive(Debug, Args)]
pub(super) struct PublishArgs {
    /// The plan file.
    plan: PathBuf,
    /// The robot's name in the service names.
    #[arg(long, default_value = DEFAULT_ROBOT)]
    robot_name: String,
    /// iceoryx2's root path, if not the default.
    #[arg(long)]
    ipc_root: Option<PathBuf>,
    /// How it joins what is going on; without it at its knot for a plan that continues another
    /// one, else after a stop.
    #[arg(long, value_enum)]
    join: Option<JoinArg>,
    /// Wait for the plan's end as well.
    #[arg(long)]
    wait: bool,
    /// Send a plan that was not verified, or that was changed since.
    #[arg(long)]
    unverified: bool,
    /// Seconds to wait for the executor's admission.
    #[arg(long, value_name = "S", default_value = "5", value_parser = seconds)]
    timeout: Duration,
}

pub(super) fn run(args: &PublishArgs) -> anyhow::Result<u8> {
    let plan = Plan::read(&args.plan)?;
    match plan.check_seal() {
        Err(error) if args.unverified => eprintln!("planner: warning: {error}; it is sent anyway"),
        checked => checked?,
    }
    let natural = if plan.continues.is_some() { Join::Knot } else { Join::Stop };
    let join = args.join.map_or(natural, Join::from);
    // An end comes after the plans before it and may be slowed down: be generous.
    let end = args.wait.then(|| Duration::from_secs_f64(10.0 * plan.duration() + 600.0));
    let patience = Patience { admission: args.timeout, end };
    publish(&plan, &args.robot_name, args.ipc_root.as_deref(), join, patience, &mut |event| {
        println!("{}", describe(event));
    })?;
    Ok(OK)
}
