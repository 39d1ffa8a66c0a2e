//! `demo`: the whole job on one stage. It plans how to sweep a chair's seat, starts a simulated arm
//! and an executor, publishes the plan, and swaps in a second one while the arm moves.

mod args;
mod hardware;
mod outcome;
mod table;
mod whole;

use std::ffi::OsString;
use std::fs::{self, File};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context;
use clap::ValueEnum;
use nullsweep_ipc_types::{EventKind, Mode, PlanId, Telemetry};
use nullsweep_planner::plan::Plan;
use serde::Serialize;

use crate::latency::of_buckets;
use crate::parts;
use crate::stage::{Part, Process, Stage};
use crate::system::{PATIENT, System};
use crate::witness::{Witness, WitnessError};
use args::Args;
use outcome::checks;

pub use args::Hardware;
pub use hardware::{Counters, Found, Missing};
pub use outcome::{Check, Outcome, PlanFigures, Planned, Swap};

/// How long a plan may take to make.
const PLANNING: Duration = Duration::from_secs(120);
/// Where in the first plan the second one takes over, as a share of its time.
const SWAP_AT: f64 = 0.35;
/// Runs with the arguments of a command line, program name first; with a hidden first argument
/// the program plays another part, see [`parts`].
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Args = match parts::begin(args) {
        Ok(args) => args,
        Err(code) => return code,
    };
    let checks = if args.whole {
        run(&args, whole::perform, whole::text).map(|outcome| outcome.checks)
    } else {
        run(&args, perform, table::text).map(|outcome| outcome.checks)
    };
    match checks {
        Ok(checks) if checks.iter().all(|c| c.ok) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("demo: {error:#}");
            ExitCode::from(if error.is::<Missing>() { Missing::CODE } else { 2 })
        }
    }
}

fn run<O: Serialize>(
    args: &Args,
    perform: fn(&Args, &Stage) -> anyhow::Result<O>,
    text: fn(&O) -> String,
) -> anyhow::Result<O> {
    args.hardware.check(args)?;
    let outcome = Stage::with(args.keep.as_deref(), |stage| perform(args, stage))?;
    match &args.json {
        Some(path) if path.as_os_str() == "-" => {
            println!("{}", serde_json::to_string_pretty(&outcome)?);
        }
        Some(path) => {
            let file = File::create(path)
                .with_context(|| format!("cannot write the figures to {}", path.display()))?;
            serde_json::to_writer_pretty(file, &outcome)?;
            println!("{}", text(&outcome));
        }
        None => println!("{}", text(&outcome)),
    }
    Ok(outcome)
}

fn perform(args: &Args, stage: &Stage) -> anyhow::Result<Outcome> {
    let start = Instant::now();
    let say = |text: &str| eprintln!("{:6.1} s  {text}", start.elapsed().as_secs_f64());

    say("planning the chair's seat: Curvature-GTSP, least task time");
    let report = std::path::absolute(&args.report)?;
    let more = [OsString::from("--report"), report.clone().into()];
    let first = plan(args, stage, "first", ["curvature", "time"], &more)?;
    let path = stage.file("first.json");
    let knot = swap_knot(&Plan::read(&path)?);
    let at_s = knot_time(&Plan::read(&path)?, knot);

    say(&format!("planning another one from its knot {knot} ({at_s:.1} s): least effort"));
    let mut from = path.clone().into_os_string();
    from.push(format!("@{knot}"));
    let second =
        plan(args, stage, "second", ["curvature", "effort"], &["--continue".into(), from])?;

    say("starting hardware and executor");
    let mut system = System::around(stage, args.hardware.start(args, stage, &path)?, PATIENT)?;

    say(&format!("sweeping: {:.1} s in the first plan", first.figures.task_time_s));
    publish(stage, "first", Duration::from_secs(60), &[])?;
    let old = system.until(|w| w.see("a plan in motion", |t| t.plan.is_some()))?.plan;
    // Mid-motion: the arm is on the surface or approaches it, and the knot is still ahead.
    let early = 0.3 * at_s * 1e9;
    system.until(|w| w.see("motion", |t| t.plan == old && t.plan_time_ns as f64 > early))?;
    say("publishing the second plan while the arm moves");
    let mut publisher = start_publish(stage, "second", &["--wait"])?;
    let (new, accepted) = system.until(|w| accepted(w, old))?;
    let patience = Duration::from_secs_f64(60.0 + 3.0 * second.figures.task_time_s);
    publisher.succeed(patience)?;
    system.until(|w| w.mode(Mode::Hold))?;
    let telemetry = system.until(|w| w.see("a last snapshot", |_| true))?;

    say("done; asking the hardware for its verdict");
    let found: Found = system.end(stage)?;
    let events = system.witness.events();
    let ended = |plan: PlanId, kind: EventKind| {
        events.iter().any(|e| e.plan == plan && e.kind == kind.wire())
    };
    let swapped = ended(old, EventKind::Superseded) && ended(new, EventKind::Finished);
    let join = found.verdict.as_ref().and_then(|v| v.run(&new.to_string()));
    let mut outcome = Outcome {
        hardware: args.hardware,
        profile: args.profile.into(),
        plans: [first, second],
        swap: Swap {
            knot,
            at_s,
            accepted_at_knot: accepted.knot,
            step_ratio: join.map(|j| j.join_step_ratio),
            velocity_step: join.map(|j| j.join_velocity_step),
        },
        judged: found.verdict.as_ref().map(|v| [v.setpoints, v.violations()]),
        endpoint: found.endpoint,
        tracking: found.tracking.context("the hardware measured nothing while plans ran")?,
        measured: found.swept.context("the hardware did not measure what was swept")?,
        lateness: of_buckets(&telemetry.lateness),
        missed_cycles: telemetry.missed_cycles,
        report,
        picture: (args.hardware == Hardware::Mujoco).then(|| args.picture.clone()),
        seconds: start.elapsed().as_secs_f64(),
        checks: Vec::new(),
    };
    outcome.checks = checks(&outcome, swapped);
    Ok(outcome)
}

/// Makes a plan in a process of its own and reads its figures.
fn plan(
    args: &Args,
    stage: &Stage,
    name: &str,
    [method, cost]: [&'static str; 2],
    more: &[OsString],
) -> anyhow::Result<Planned> {
    let figures = stage.file(&format!("{name}-figures.json"));
    let mut options: Vec<OsString> = ["plan", "--demo", "chair-seat"].map(Into::into).to_vec();
    options.extend(["--method", method, "--cost", cost].map(Into::into));
    options.extend(["--seed".into(), args.seed.to_string().into()]);
    options.extend(["--ik-samples".into(), args.ik_samples.to_string().into()]);
    options.extend(["--v-max".into(), args.v_max.to_string().into()]);
    let profile = args.profile.to_possible_value();
    options.extend(profile.map(|p| format!("--profile={}", p.get_name()).into()));
    options.extend(["--base".into(), args.base.clone().into()]);
    if args.base != "auto" {
        options.extend(["--torso".into(), args.torso.to_string().into()]);
    }
    options.extend(["--out".into(), stage.file(&format!("{name}.json")).into()]);
    options.extend(["--json".into(), figures.clone().into()]);
    options.extend(more.iter().cloned());
    let mut planner = stage.start(Part::Planner, &format!("planner-{name}"), options)?;
    planner.succeed(PLANNING)?;
    let text = fs::read(&figures).with_context(|| format!("no {}", figures.display()))?;
    let figures = serde_json::from_slice(&text).context("the planner's figures")?;
    Ok(Planned { method, cost, figures })
}

/// The knot at about [`SWAP_AT`] of the plan's time.
fn swap_knot(plan: &Plan) -> usize {
    let due = SWAP_AT * plan.duration();
    (0..plan.knots.len()).find(|&k| knot_time(plan, k) >= due).unwrap_or(0)
}

fn knot_time(plan: &Plan, knot: usize) -> f64 {
    plan.knots[knot].time_ns as f64 * 1e-9
}

fn start_publish(stage: &Stage, name: &str, more: &[&str]) -> anyhow::Result<Process> {
    let mut options: Vec<OsString> = vec!["publish".into()];
    options.push(stage.file(&format!("{name}.json")).into());
    options.extend(stage.place());
    options.extend(more.iter().map(OsString::from));
    Ok(stage.start(Part::Planner, &format!("publish-{name}"), options)?)
}

fn publish(stage: &Stage, name: &str, patience: Duration, more: &[&str]) -> anyhow::Result<()> {
    start_publish(stage, name, more)?.succeed(patience)
}

/// The plan that was answered after `old` began, and the telemetry of that moment.
fn accepted(witness: &mut Witness, old: PlanId) -> Result<(PlanId, Telemetry), WitnessError> {
    let answers = [EventKind::Accepted, EventKind::Rejected].map(EventKind::wire);
    witness.until("an answer to the second plan".into(), |w| {
        let event = w.events().iter().find(|e| e.plan != old && answers.contains(&e.kind))?;
        Some((event.plan, *w.telemetry()?))
    })
}
