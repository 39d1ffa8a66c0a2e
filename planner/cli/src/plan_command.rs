//! `planner plan`, as it is called: a plan, a program of several stops, or one of its jobs.

use clap::Args;

use crate::jobs;
use crate::plan::{self, PlanArgs};
use crate::site::SiteArgs;
use crate::stops::{self, StopsArgs};

/// A plan by itself, not in place of one that runs.
#[derive(Debug, Args)]
pub(super) struct PlanCommandArgs {
    #[command(flatten)]
    pub(super) plan: PlanArgs,
    #[command(flatten)]
    pub(super) stops: StopsArgs,
    #[command(flatten)]
    pub(super) site: SiteArgs,
}

pub(super) fn run(command: &PlanCommandArgs) -> anyhow::Result<u8> {
    let PlanCommandArgs { plan: args, stops, site } = command;
    if let Some(job) = stops.job() {
        return jobs::work(job);
    }
    if let Some(folder) = stops.jobs() {
        return jobs::write(stops, args, site.site(), folder);
    }
    if stops.is_asked() {
        return stops::run(stops, args, site.site());
    }
    Ok(plan::make(args, site.site(), args.after()?)?.0)
}
