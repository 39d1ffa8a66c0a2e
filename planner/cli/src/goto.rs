//! `planner goto`.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use nullsweep_planner::link::publish::Join;
use nullsweep_planner::plan::Plan;
use nullsweep_robot::{JointVector, Tool};

use crate::bars::Bars;
use crate::exit::{OK, Usage, VIOLATIONS};
use crate::numbers::{Held, Place};
use crate::output::{complain, say, say_on, writable};
use crate::posture::is_known;
use crate::posture_arg::PostureArg;
use crate::robot::{RobotArgs, tool_file};
use crate::send::{SendArgs, outlook, resting};
use crate::site::SiteArgs;
use crate::way::{Broken, Way, WayArgs};

#[derive(Debug, Args)]
pub(super) struct GotoArgs {
    /// Where to: a posture by its name (home, start, …) or its joints, Q1,Q2,…; left out where --plan
    /// says it.
    #[arg(value_name = "POSTURE", allow_hyphen_values = true)]
    target: Option<String>,
    /// The scans of what is around the arm, as they were given to `plan`.
    scans: Vec<PathBuf>,
    /// To this plan's first knot, or, with a posture, standing as that plan has it.
    #[arg(long, value_name = "PLAN")]
    plan: Option<PathBuf>,
    /// Where the robot stands in the floor frame, without a plan: x,y,yaw.
    #[arg(long, value_name = "X,Y,YAW", allow_hyphen_values = true, conflicts_with = "plan")]
    base: Option<Place>,
    /// Height of the PR2's torso joint, without a plan. [m]
    #[arg(long, value_name = "M", value_parser = crate::numbers::finite, conflicts_with = "plan")]
    torso: Option<f64>,
    /// Position of another held joint, without a plan: NAME=VALUE.
    #[arg(long, value_name = "NAME=VALUE", allow_hyphen_values = true, conflicts_with = "plan")]
    held: Vec<Held>,
    /// The tool, a TOML file, without a plan; else a sponge of 0.10 × 0.07 m.
    #[arg(long, value_name = "FILE", conflicts_with = "plan")]
    tool: Option<PathBuf>,
    /// Turn joints without end back to the posture's own angle, by the whole turns that sweeping has
    /// wound them up by: for hoses and cables.
    #[arg(long)]
    unwind: bool,
    #[command(flatten)]
    robot: RobotArgs,
    #[command(flatten)]
    way: WayArgs,
    #[command(flatten)]
    site: SiteArgs,
    #[command(flatten)]
    send: SendArgs,
    /// Write the plan here instead of sending it: `planner publish` does that.
    #[arg(long, short, value_name = "FILE")]
    out: Option<PathBuf>,
}

pub(super) fn run(args: &GotoArgs) -> anyhow::Result<u8> {
    if let Some(out) = &args.out {
        writable(out)?;
    }
    let bars = Bars::new();
    let plan = args.plan.as_deref().map(Plan::read).transpose()?;
    let (target, scans) = args.asked(plan.is_some())?;
    let way = match &plan {
        Some(plan) => Way::of(plan, &args.robot, args.site.site(), &scans),
        None => args.standing(&scans)?,
    };
    let way = Way { unwinds: args.unwind, ..way };
    let arm = way.arm()?;
    let to = match (&target, &plan) {
        (Some(posture), _) => posture.resolve(&arm, &args.robot, args.site.site(), &bars)?,
        (None, Some(plan)) => first(plan)?,
        (None, None) => return Err(Usage(WHERE.into()).into()),
    };
    let found = match args.way.find(&way, to, &bars) {
        Err(error) if error.is::<Broken>() => {
            complain!("planner: {error}");
            return Ok(VIOLATIONS);
        }
        found => found?,
    };
    let Some(found) = found else {
        say!("the arm is there already");
        let in_motion = |plan: &&Plan| plan.knots.first().is_some_and(|k| k.v != JointVector::ZERO);
        if let (None, Some(_)) = (&target, plan.as_ref().filter(in_motion)) {
            say!(
                "but the plan begins in motion, as it takes over from one that runs: once that was stopped, \
                 `planner replan --running THAT SCAN…` plans anew from where the arm stands"
            );
        }
        return Ok(OK);
    };
    let now = resting(args.site.site(), &arm);
    say_on!("{}{}", outlook(&found.plan, Some(&arm), now.as_ref()), found.room());
    let found = found.plan;
    if let Some(out) = &args.out {
        found.write(out)?;
        say!("plan: {}", out.display());
        return Ok(OK);
    }
    args.send.confirm()?;
    args.send.send((&found, None), Some(&arm), args.site.site(), Join::Stop, true)?;
    Ok(OK)
}

const WHERE: &str = "where to? Give a posture (home, or its joints Q1,Q2,…) or --plan PLAN";

/// Where a plan begins.
fn first(plan: &Plan) -> anyhow::Result<JointVector> {
    Ok(plan.knots.first().context("the plan has no knots")?.q)
}

impl GotoArgs {
    /// The posture that is asked for, and the scans. With a plan the posture may be left out.
    fn asked(&self, planned: bool) -> anyhow::Result<(Option<PostureArg>, Vec<PathBuf>)> {
        let Some(first) = &self.target else { return Ok((None, Vec::new())) };
        if planned && Path::new(first).is_file() && !is_known(&self.robot, first)? {
            let first = PathBuf::from(first);
            return Ok((None, std::iter::once(first).chain(self.scans.iter().cloned()).collect()));
        }
        match first.parse::<PostureArg>() {
            Ok(posture) => Ok((Some(posture), self.scans.clone())),
            Err(why) => {
                Err(Usage(format!("`{first}` is neither a posture nor a file: {why}")).into())
            }
        }
    }

    /// Where the arguments have the robot stand.
    fn standing<'a>(&'a self, scans: &'a [PathBuf]) -> anyhow::Result<Way<'a>> {
        let held = crate::numbers::held(&self.held, self.torso);
        let place = match self.base {
            Some(place) => place,
            None if scans.is_empty() && !self.way.has_demo() => {
                Place { base: [0.0; 3], height: 0.0 }
            }
            None => {
                let say = "where does the robot stand? Give --base x,y,yaw, or --plan PLAN for where \
                           that plan has it";
                return Err(Usage(say.into()).into());
            }
        };
        Ok(Way {
            robot: &self.robot,
            site: self.site.site(),
            scans,
            stance: place.stance(held),
            tool: self.tool.as_deref().map_or(Ok(Tool::default()), tool_file)?,
            plan: None,
            unwinds: false,
        })
    }
}
