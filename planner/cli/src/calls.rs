//! What the commands do, for programs that call them: the same words mean the same, and what a shell is
//! told comes back as values.

use std::ffi::OsString;
use std::sync::Arc;

use clap::Args;
use nalgebra::Isometry3;
use nullsweep_planner::pipeline::After;
use nullsweep_planner::plan::Plan;
use nullsweep_planner::poses::{Poses, tip_tool};
use nullsweep_planner::progress::Progress;
use nullsweep_planner::verify::{Verification, Violation};
use nullsweep_planner::workcell::Scene;
use nullsweep_report::ReportData;
use nullsweep_robot::{Arm, Tool};
use serde::Serialize;

use crate::bars::Bars;
use crate::exit::Usage;
use crate::follow::PathArgs;
use crate::line::parse;
use crate::numbers::{self, Held, finite};
use crate::plan_command::PlanCommandArgs;
use crate::robot::{RobotArgs, tool_file};
use crate::site::SiteArgs;
use crate::task::PoseArgs;
use crate::verify::AgainstArgs;

/// A listener that is told what bars show.
pub type Listener = Arc<dyn Progress + Send>;

/// A plan with what is known of it.
pub struct Planned {
    /// The plan; as verified where nothing is wrong with it.
    pub plan: Plan,
    /// What it breaks: such a plan is for looking at.
    pub violations: Vec<Violation>,
    /// Every figure of the run, as `--json` writes them.
    pub figures: String,
    page: Page,
}

/// Makes a page when it is asked for.
type Page = Box<dyn Fn() -> anyhow::Result<ReportData> + Send + Sync>;

impl Planned {
    fn new(
        plan: &Plan,
        verification: &Verification,
        figures: &impl Serialize,
        page: Page,
    ) -> anyhow::Result<Self> {
        let (plan, violations) = (plan.clone(), verification.violations.clone());
        let plan = if violations.is_empty() { plan.sealed() } else { plan };
        Ok(Self { plan, violations, figures: serde_json::to_string(figures)?, page })
    }

    /// The page that `--report` writes.
    ///
    /// # Errors
    /// The robot's shapes cannot be read any more.
    pub fn page(&self) -> anyhow::Result<ReportData> {
        (self.page)()
    }
}

/// `planner plan`: `words` are its arguments.
///
/// # Errors
/// As the command's.
pub fn plan(
    words: &[OsString],
    after: Option<After>,
    listener: Listener,
) -> anyhow::Result<Planned> {
    let args: PlanCommandArgs = parse(words)?;
    if args.stops.is_asked() {
        let why =
            "--stops makes a program of several plans: the command has it, a function has not";
        return Err(Usage(why.into()).into());
    }
    let made = args.plan.work(args.site.site(), after, &Bars::of(listener))?;
    let made = Arc::new(made);
    let (outcome, page) = (&made.outcome, Arc::clone(&made));
    let found = &outcome.figures.verification;
    Planned::new(&outcome.plan, found, &outcome.figures, Box::new(move || page.page()))
}

/// `planner follow` along segments of poses of the tool in the robot's root frame.
///
/// # Errors
/// As the command's.
pub fn follow(
    words: &[OsString],
    segments: Vec<Vec<Isometry3<f64>>>,
    listener: Listener,
) -> anyhow::Result<Planned> {
    let args: FollowArgs = parse(words)?;
    let poses = Poses { segments, notes: Vec::new() };
    let made = Arc::new(args.follow.work(poses, args.site.site(), &Bars::of(listener))?);
    let (outcome, page) = (&made.outcome, Arc::clone(&made));
    let found = &outcome.verification;
    Planned::new(&outcome.plan, found, &outcome.figures, Box::new(move || page.drawn().page()))
}

/// `planner task` through poses of the tool in the robot's root frame.
///
/// # Errors
/// As the command's.
pub fn task(
    words: &[OsString],
    poses: Vec<Isometry3<f64>>,
    listener: Listener,
) -> anyhow::Result<Planned> {
    let args: TaskArgs = parse(words)?;
    let poses = Poses { segments: vec![poses], notes: Vec::new() };
    let made = Arc::new(args.task.work(poses, args.site.site(), &Bars::of(listener))?);
    let (outcome, page) = (&made.outcome, Arc::clone(&made));
    let found = &outcome.verification;
    Planned::new(&outcome.plan, found, &outcome.figures, Box::new(move || page.drawn().page()))
}

/// `planner verify` of a plan.
///
/// # Errors
/// As the command's.
pub fn verify(words: &[OsString], plan: &Plan, listener: Listener) -> anyhow::Result<Planned> {
    let args: AgainstArgs = parse(words)?;
    let checked = args.check(plan, &Bars::of(listener))?;
    let (found, shown) = (checked.verification.clone(), plan.clone());
    Planned::new(plan, &found, &found, Box::new(move || checked.page(&shown)))
}

/// The scene that `planner plan` of these words works on, in the floor frame.
///
/// # Errors
/// As the command's.
pub fn scene(words: &[OsString], listener: Listener) -> anyhow::Result<Scene> {
    let args: PlanCommandArgs = parse(words)?;
    let bars = Bars::of(listener);
    args.plan.scene(&bars)
}

#[derive(Debug, Args)]
struct FollowArgs {
    #[command(flatten)]
    follow: PathArgs,
    #[command(flatten)]
    site: SiteArgs,
}

#[derive(Debug, Args)]
struct TaskArgs {
    #[command(flatten)]
    task: PoseArgs,
    #[command(flatten)]
    site: SiteArgs,
}

#[derive(Debug, Args)]
struct ArmArgs {
    #[command(flatten)]
    robot: RobotArgs,
    #[arg(long)]
    tool: Option<std::path::PathBuf>,
    #[arg(long, value_parser = finite)]
    torso: Option<f64>,
    #[arg(long, allow_hyphen_values = true)]
    held: Vec<Held>,
}

/// The arm and its tool: one at the tip itself where none is named.
///
/// # Errors
/// Their files cannot be used.
pub fn arm(words: &[OsString]) -> anyhow::Result<(Arm, Tool)> {
    let args: ArmArgs = parse(words)?;
    let held = numbers::held(&args.held, args.torso);
    let held: Vec<(&str, f64)> = held.iter().map(|(name, at)| (name.as_str(), *at)).collect();
    let tool = args.tool.as_deref().map_or(Ok(tip_tool()), tool_file)?;
    Ok((args.robot.arm()?.with_held(&held)?, tool))
}

/// What the command line says of an error: its causes, and the advice that it has for it.
#[must_use]
pub fn told(error: &anyhow::Error) -> String {
    let causes = nullsweep_cell::causes(error.as_ref());
    match crate::advice::advice(error) {
        Some(advice) => format!("{causes}\nhelp: {advice}"),
        None => causes.to_string(),
    }
}

/// The exit code that the command line has for an error.
#[must_use]
pub fn code(error: &anyhow::Error) -> u8 {
    crate::exit::of(error)
}
