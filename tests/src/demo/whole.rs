//! `demo --whole`: a chair from several places by both arms, with who works through the program and an
//! executor killed on the way.

use std::ffi::OsString;
use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::ValueEnum;
use comfy_table::{Table, presets};
use nullsweep_planner::plan::Program;
use serde::Serialize;

use super::args::Args;
use super::outcome::Check;
use crate::crew::{Crew, Found};
use crate::stage::{Part, Process, Stage};
use crate::system::{PATIENT, PATIENT_MOCK};

/// How long the program may take to make.
const PLANNING: Duration = Duration::from_secs(1200);
/// How much of a plan is done when somebody is killed.
const KILLED_AT: f64 = 0.4;
/// Where the base stands at first.
const STANDS: &str = "-1.6,0,0";
/// What is swept may be this much less, or more, than the program promises.
const WITHIN: f64 = 0.01;

/// Everything that it tells.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Outcome {
    /// Stops, plans and arms of the program.
    stops: usize,
    plans: usize,
    arms: usize,
    /// Sum of the plans' durations. \[s\]
    task_time_s: f64,
    /// Share of all scanned points.
    coverage_planned: f64,
    coverage_measured: f64,
    /// Setpoints that were judged, and violations among them.
    setpoints: u64,
    violations: u64,
    drives: u64,
    /// In which stop and plan each was killed, from 1.
    publisher_killed: [usize; 2],
    executor_killed: [usize; 2],
    /// The program's report.
    report: std::path::PathBuf,
    /// How long all of it took. \[s\]
    seconds: f64,
    pub(super) checks: Vec<Check>,
}

/// Plans, works through the program, kills on the way, and goes on.
pub(super) fn perform(args: &Args, stage: &Stage) -> anyhow::Result<Outcome> {
    let start = Instant::now();
    let say = |text: &str| eprintln!("{:6.1} s  {text}", start.elapsed().as_secs_f64());
    say("planning the chair from three stops, by both arms");
    let report = std::path::absolute(&args.report)?;
    let path = stage.file("program.json");
    let options = planning(args, stage, &report);
    stage.start(Part::Planner, "planner", options)?.succeed(PLANNING)?;
    let program = Program::read(&path)?.context("the planner wrote no program")?;
    // In the order in which they are worked through.
    let works: Vec<(usize, usize, f64)> = program
        .stops
        .iter()
        .enumerate()
        .flat_map(|(s, stop)| {
            stop.works.iter().enumerate().map(move |(w, work)| (s, w, work.plan.duration()))
        })
        .collect();
    // The longest plan but the first loses its executor.
    let longest = (1..works.len()).max_by(|&a, &b| works[a].2.total_cmp(&works[b].2));
    let longest = longest.context("the program has one plan alone")?;
    let time = program.totals.task_time_s;
    say(&format!(
        "starting the robot and its executors: {} stops, {} plans of {time:.0} s",
        program.stops.len(),
        works.len()
    ));
    let stands = ["--stands", STANDS];
    let mock = [&PATIENT_MOCK[..], &stands].concat();
    let mut crew = Crew::start(stage, &path, &mock, &PATIENT)?;
    let patience = Duration::from_secs_f64(600.0 + 3.0 * time);

    let mut publisher = crew.publish(stage, "publish-1", &["--yes"])?;
    crew.begun(1, &mut publisher, patience)?;
    pause(works[0].2);
    say("killing who works through the program, in the middle of its first plan");
    publisher.kill()?;

    say("resuming");
    let resume = ["--yes", "--resume", "--demo", "chair"];
    let mut publisher = crew.publish(stage, "publish-2", &resume)?;
    crew.begun(longest + 1, &mut publisher, patience)?;
    pause(works[longest].2);
    let (s, w, _) = works[longest];
    say(&format!("killing the executor, in the middle of plan {} at stop {}", w + 1, s + 1));
    let arm = &program.stops[s].works[w].arm;
    let seat = crew.seats.iter().position(|seat| seat.arm == *arm).context("no such executor")?;
    crew.replace(stage, seat, &PATIENT)?;
    let lost = ended(&mut publisher)?;

    say("resuming: what is left of that plan is planned anew");
    let figures = stage.file("publish.json");
    let json = figures.to_str().context("the stage's folder is no text")?;
    let mut publisher =
        crew.publish(stage, "publish-3", &[&resume[..], &["--json", json]].concat())?;
    publisher.succeed(patience)?;

    say("done; asking the robot for its verdict");
    let found: Found = crew.end(stage)?;
    let mut arms: Vec<&str> = program.works().map(|(_, work)| work.arm.as_str()).collect();
    arms.sort_unstable();
    arms.dedup();
    let rest = fs::read_to_string(&figures)?.contains("\"rest-finished\"");
    let mut outcome = Outcome {
        stops: program.stops.len(),
        plans: works.len(),
        arms: arms.len(),
        task_time_s: time,
        coverage_planned: program.totals.coverage_all,
        coverage_measured: found.swept.swept as f64 / program.totals.points.max(1) as f64,
        setpoints: found.arms.iter().map(|arm| arm.verdict.setpoints).sum(),
        violations: found.violations,
        drives: found.drives,
        publisher_killed: [works[0].0 + 1, works[0].1 + 1],
        executor_killed: [s + 1, w + 1],
        report,
        seconds: start.elapsed().as_secs_f64(),
        checks: Vec::new(),
    };
    outcome.checks = checks(&outcome, lost, rest);
    Ok(outcome)
}

/// The arguments of the planner.
fn planning(args: &Args, stage: &Stage, report: &std::path::Path) -> Vec<OsString> {
    let mut options: Vec<OsString> =
        ["plan", "--demo", "chair", "--stops", "3", "--refinements", "1"].map(Into::into).to_vec();
    options.extend(["--seed".into(), args.seed.to_string().into()]);
    options.extend(["--ik-samples".into(), args.ik_samples.to_string().into()]);
    options.extend(["--v-max".into(), args.v_max.to_string().into()]);
    let profile = args.profile.to_possible_value();
    options.extend(profile.map(|p| format!("--profile={}", p.get_name()).into()));
    options.extend(["--out".into(), stage.file("program.json").into()]);
    options.extend(["--report".into(), report.into()]);
    options
}

/// Waits for a part of a plan.
fn pause(duration: f64) {
    thread::sleep(Duration::from_secs_f64(KILLED_AT * duration));
}

/// Waits for the end of a process that cannot end well, and gives its exit code.
fn ended(process: &mut Process) -> anyhow::Result<Option<i32>> {
    match process.wait(crate::witness::PATIENCE)? {
        Some(status) if status.success() => {
            bail!("{} ended well, its executor killed", process.name())
        }
        Some(status) => Ok(status.code()),
        None => bail!("{} did not notice that its executor is gone", process.name()),
    }
}

fn checks(outcome: &Outcome, lost: Option<i32>, rest: bool) -> Vec<Check> {
    let Outcome { coverage_planned: planned, coverage_measured: measured, .. } = outcome;
    vec![
        Check {
            what: "the program has several stops, and work for both arms",
            ok: outcome.stops > 1 && outcome.arms == 2,
            found: format!("{} stops, {} arms", outcome.stops, outcome.arms),
        },
        Check {
            what: "the loss of the executor was told",
            ok: lost == Some(i32::from(nullsweep_cli::LOST)),
            found: format!("exit code {lost:?}"),
        },
        Check {
            what: "what was left of the plan was planned anew",
            ok: rest,
            found: if rest { "and swept" } else { "no" }.into(),
        },
        Check {
            what: "the robot saw no violation",
            ok: outcome.violations == 0 && outcome.setpoints > 0,
            found: format!("{} of {}", outcome.violations, outcome.setpoints),
        },
        Check {
            what: "what was measured is what was planned, within 1 %",
            ok: (measured - planned).abs() <= WITHIN,
            found: format!("{:.2} % for {:.2} %", 100.0 * measured, 100.0 * planned),
        },
    ]
}

/// The table and the checks.
pub(super) fn text(outcome: &Outcome) -> String {
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(["the whole chair", ""]);
    let mut row = |what: &str, value: String| {
        table.add_row([what.to_owned(), value]);
    };
    let [[s, w], [t, v]] = [outcome.publisher_killed, outcome.executor_killed];
    row("stops, plans, arms", format!("{}, {}, {}", outcome.stops, outcome.plans, outcome.arms));
    row("task time", format!("{:.1} s", outcome.task_time_s));
    row("publisher killed", format!("at stop {s}, in plan {w}"));
    row("executor killed", format!("at stop {t}, in plan {v}"));
    row("drives", outcome.drives.to_string());
    row("planned coverage, all", format!("{:.2} %", 100.0 * outcome.coverage_planned));
    row("measured coverage, all", format!("{:.2} %", 100.0 * outcome.coverage_measured));
    row("all of it took", format!("{:.1} s", outcome.seconds));
    let mut text = table.to_string();
    for Check { what, ok, found } in &outcome.checks {
        let mark = if *ok { "ok  " } else { "FAIL" };
        text += &format!("\n{mark} {what}: {found}");
    }
    text + &format!("\nreport: {}", outcome.report.display())
}
