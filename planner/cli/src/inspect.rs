//! `planner inspect`.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use nullsweep_planner::cost::{Effort, of_path};
use nullsweep_planner::pipeline::missed_by;
use nullsweep_planner::plan::{Plan, Program, Stretch};
use nullsweep_planner::sweep::{DIP, MissedPoints, Pace, Passes, coverage, passes_over};
use nullsweep_planner::workcell::stance::told;
use nullsweep_robot::{Arm, MAX_DOF};
use serde::Serialize;

use crate::exit::OK;
use crate::figures::{OWN_SURFACE, missed_rows, pace_rows};
use crate::json::write_json;
use crate::numbers::positive;
use crate::output::{say, say_on};
use crate::program;
use crate::robot::RobotArgs;
use crate::sheet::sheet;

#[derive(Debug, Args)]
pub(super) struct InspectArgs {
    /// The plan file, or a program's.
    plan: PathBuf,
    /// Of a program: write each plan into this folder as a file of its own, stop-1-1.json and so on.
    #[arg(long, value_name = "FOLDER")]
    plans: Option<PathBuf>,
    #[command(flatten)]
    robot: RobotArgs,
    /// What counts as a dip of the tool's speed on the surface. [m/s]
    #[arg(long, value_name = "M/S", default_value_t = DIP, value_parser = positive)]
    dip: f64,
    /// Write the figures as JSON to a file, or `-`, instead of a table.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What a plan file holds.
#[derive(Debug, Serialize)]
struct Summary {
    robot: String,
    fingerprint: String,
    base: [f64; 3],
    base_height: f64,
    /// None of given poses, which no method orders and no cost of these.
    #[serde(skip_serializing_if = "Option::is_none")]
    method: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    cost: Option<String>,
    seed: u64,
    /// Whether it is as it was verified; if not, why.
    verified: bool,
    unverified_because: Option<String>,
    knots: usize,
    knots_on_surface: usize,
    patches_visited: usize,
    duration_s: f64,
    effort_rad: f64,
    /// How fast it goes; nothing where the plan is of another arm than the one given.
    pace: Option<Pace>,
    #[serde(flatten)]
    passes: Option<Passes>,
    /// Reachable points that it does not sweep, by why; nothing where the plan is of another arm.
    missed: Option<Vec<MissedPoints>>,
    /// Whether what other things hide from its tool counts as worked on: a plan holds its own surface alone.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    hidden_by_own_surface_alone: bool,
    continues_at_knot: Option<u32>,
    joints: Vec<JointSummary>,
    held: Vec<(String, f64)>,
}

#[derive(Debug, Serialize)]
struct JointSummary {
    name: String,
    min: f64,
    max: f64,
    displacement: f64,
}

pub(super) fn run(args: &InspectArgs) -> anyhow::Result<u8> {
    if let Some(program) = Program::read(&args.plan)? {
        return of_program(args, &program);
    }
    let plan = Plan::read(&args.plan)?;
    let summary = match own_arm(args, &plan)? {
        Some(arm) => {
            let pace = Pace::of(plan.trajectory(), plan.begins_in_motion(), &arm, args.dip);
            let passes = Passes::of(&passes_over(&plan.scan(), [plan.trajectory()], &arm));
            let missed = Some(missed(&plan, &arm));
            Summary { pace: Some(pace), passes: Some(passes), missed, ..summarise(&plan) }
        }
        None => summarise(&plan),
    };
    match &args.json {
        Some(path) => write_json(&summary, path)?,
        None => say_on!("{}", tables(&summary)),
    }
    Ok(OK)
}

/// A program's stops and totals; its plans as files of their own where that is asked for.
fn of_program(args: &InspectArgs, program: &Program) -> anyhow::Result<u8> {
    if let Some(folder) = &args.plans {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        for (s, stop) in program.stops.iter().enumerate() {
            for (w, work) in stop.works.iter().enumerate() {
                work.plan.write(&folder.join(format!("stop-{}-{}.json", s + 1, w + 1)))?;
            }
        }
    }
    match &args.json {
        Some(path) => write_json(&program::figures(program), path)?,
        None => {
            let verified =
                program.check_seal().err().map_or_else(|| "yes".into(), |e| e.to_string());
            say!("{}\nverified: {verified}", program::table(program));
        }
    }
    Ok(OK)
}

/// The arm given, as the plan has it; nothing where that is another one.
fn own_arm(args: &InspectArgs, plan: &Plan) -> anyhow::Result<Option<Arm>> {
    let arm = args.robot.arm()?;
    let is_own = plan.fingerprint == arm.fingerprint() && plan.joints == arm.joint_names();
    if !is_own || plan.knots.len() < 2 || plan.check_bounds().is_err() {
        return Ok(None);
    }
    let held: Vec<(&str, f64)> = plan.held.iter().map(|h| (h.name.as_str(), h.position)).collect();
    Ok(Some(arm.with_held(&held)?))
}

/// The reachable points that the plan and what led to it do not sweep; none of given poses.
fn missed(plan: &Plan, arm: &Arm) -> Vec<MissedPoints> {
    if plan.is_of_poses() {
        return Vec::new();
    }
    let followed = plan.followed(plan.knots.len());
    let motions = followed.iter().map(Stretch::trajectory);
    missed_by(plan, &coverage::swept_by(&plan.scan(), motions, arm), arm)
}

fn summarise(plan: &Plan) -> Summary {
    let path: Vec<_> = plan.knots.iter().map(|k| k.q).collect();
    let joints = plan.joints.iter().take(MAX_DOF).enumerate().map(|(j, name)| {
        let values = path.iter().map(|q| q[j]);
        JointSummary {
            name: name.clone(),
            min: values.clone().fold(f64::INFINITY, f64::min),
            max: values.fold(f64::NEG_INFINITY, f64::max),
            displacement: path.windows(2).map(|w| (w[1][j] - w[0][j]).abs()).sum(),
        }
    });
    Summary {
        robot: plan.robot.clone(),
        fingerprint: format!("{:016x}", plan.fingerprint),
        base: plan.base,
        base_height: plan.base_height,
        method: (!plan.is_of_poses()).then(|| format!("{:?}", plan.method)),
        cost: (!plan.is_of_poses()).then(|| format!("{:?}", plan.cost)),
        seed: plan.seed,
        verified: plan.check_seal().is_ok(),
        unverified_because: plan.check_seal().err().map(|why| why.to_string()),
        knots: plan.knots.len(),
        knots_on_surface: plan.knots.iter().filter(|k| k.line.is_some()).count(),
        patches_visited: plan.knots.iter().filter(|k| k.patch.is_some()).count(),
        duration_s: plan.duration(),
        effort_rad: of_path(&Effort, &path),
        pace: None,
        passes: None,
        missed: None,
        hidden_by_own_surface_alone: !plan.is_of_poses() && !plan.tool.touches(),
        continues_at_knot: plan.continues.as_ref().map(|c| c.knot),
        joints: joints.collect(),
        held: plan.held.iter().map(|h| (h.name.clone(), h.position)).collect(),
    }
}

fn tables(s: &Summary) -> String {
    let mut plan = sheet(["plan", ""]);
    plan.add_row(["robot", &format!("{} ({})", s.robot, s.fingerprint)]);
    plan.add_row(["base x, y, yaw", &told(&s.base)]);
    if s.base_height != 0.0 {
        plan.add_row(["base above the floor", &format!("{:.3} m", s.base_height)]);
    }
    match (&s.method, &s.cost) {
        (Some(method), Some(cost)) => {
            plan.add_row(["method, cost, seed", &format!("{method}, {cost}, {}", s.seed)])
        }
        _ => plan.add_row(["seed", &s.seed.to_string()]),
    };
    plan.add_row(["verified", s.unverified_because.as_deref().map_or("yes", |why| why)]);
    plan.add_row(["knots (on the surface)", &format!("{} ({})", s.knots, s.knots_on_surface)]);
    let visited = if s.method.is_some() { "patches visited" } else { "poses met" };
    plan.add_row([visited, &s.patches_visited.to_string()]);
    plan.add_row(["duration", &format!("{:.2} s", s.duration_s)]);
    plan.add_row(["effort", &format!("{:.2} rad", s.effort_rad)]);
    for [name, value] in s.pace.as_ref().map(pace_rows).unwrap_or_default() {
        plan.add_row([name, value]);
    }
    if let Some(passes) = &s.passes {
        let value = format!("{:.0}, {:.0}", passes.passes_p50, passes.passes_p95);
        plan.add_row(["passes over a point, p50, p95", &value]);
    }
    for [name, value] in s.missed.as_deref().map(missed_rows).unwrap_or_default() {
        plan.add_row([name, value]);
    }
    if s.hidden_by_own_surface_alone && s.missed.is_some() {
        plan.add_row(["counted", OWN_SURFACE]);
    }
    if let Some(knot) = s.continues_at_knot {
        plan.add_row(["continues another plan at knot", &knot.to_string()]);
    }
    let mut joints = sheet(["joint", "min", "max", "displacement"]);
    for j in &s.joints {
        joints.add_row([
            j.name.clone(),
            format!("{:.3}", j.min),
            format!("{:.3}", j.max),
            format!("{:.2}", j.displacement),
        ]);
    }
    for (name, position) in &s.held {
        let held = format!("{position:.4}");
        joints.add_row([name.clone(), held.clone(), held, "held".into()]);
    }
    format!("{plan}\n{joints}\n")
}
