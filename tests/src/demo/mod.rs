//! `demo`: the whole job on one stage. It plans how to sweep a chair's seat, starts a simulated arm
//! and an executor, publishes the plan, and swaps in a second one while the arm moves.

mod hardware;
mod table;

use std::ffi::OsString;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::{Parser, ValueEnum};
use nullsweep_cli::ProfileArg;
use nullsweep_ipc_types::{EventKind, Mode, PlanId, Telemetry};
use nullsweep_planner::plan::Plan;
use nullsweep_planner::plan::Profile;
use serde::{Deserialize, Serialize};

use crate::endpoint::Fidelity;
use crate::latency::{Percentiles, of_buckets};
use crate::measured::Swept;
use crate::parts;
use crate::stage::{Part, Process, Stage};
use crate::system::{PATIENT, System};
use crate::tracking::Tracking;
use crate::witness::{Witness, WitnessError};

pub use hardware::{Deeds, Found, Hardware, Missing};

/// How long a plan may take to make.
const PLANNING: Duration = Duration::from_secs(120);
/// Where in the first plan the second one takes over, as a share of its time.
const SWAP_AT: f64 = 0.35;
/// How much less than planned the measured coverage may be: the arm follows with an error of a
/// few millimetres.
const COVERAGE_SLACK: f64 = 0.02;
/// How far the arm may be from its setpoint, in 95 of 100 moments. \[rad\]
const TRACKING_P95: f64 = 0.02;
/// How much a joint's velocity may change in the cycle of the swap where accelerations are
/// limited: more than any joint's limit makes of a millisecond. \[rad/s\]
const SWAP_VELOCITY_STEP: f64 = 0.02;

/// Plans a chair's seat, sweeps it with a simulated PR2, and swaps in a second plan mid-motion.
#[derive(Debug, Parser)]
#[command(
    name = "demo",
    version,
    after_help = "Exit codes: 0 both plans passed their check, the swap took place, the endpoint \
                  saw nothing wrong, and what was measured covers what was planned; 1 one of them \
                  is not so; 2 the demo failed; 77 what --hardware needs is not installed."
)]
struct Args {
    /// What stands in for the robot
    #[arg(long, value_enum, default_value = "mock")]
    hardware: Hardware,
    /// How fast the plans go along their paths
    #[arg(long, value_enum, default_value = "acceleration")]
    profile: ProfileArg,
    /// With --hardware mujoco: the Python that has its packages
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    python: String,
    /// With --hardware mujoco: where the picture of the arm at the chair is written
    #[arg(long, default_value = "demo.nullsweep-mujoco.png", value_name = "FILE")]
    picture: PathBuf,
    /// Where the report of the first plan is written
    #[arg(long, default_value = "demo.nullsweep-report.html", value_name = "FILE")]
    report: PathBuf,
    /// Write every figure as JSON, to a file or to standard output with -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Copy the plans and the processes' output to this folder
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// Where the robot stands: x,y,yaw before the chair, or auto, which searches for longer
    #[arg(
        long,
        default_value = "0.1,0.55,-1.2",
        allow_hyphen_values = true,
        value_name = "X,Y,YAW"
    )]
    base: String,
    /// Height of the torso, with a given base, in m
    #[arg(long, default_value_t = 0.2, value_name = "H")]
    torso: f64,
    /// Velocity of the fastest joint, in rad/s: slow enough to be watched
    #[arg(long, default_value_t = 0.8, value_name = "V")]
    v_max: f64,
    /// With --hardware mock: how true to a robot the arm is
    #[arg(long, value_enum, default_value = "mechanism")]
    fidelity: Fidelity,
    /// Seed of both plans
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Samples of the inverse kinematics at each tool pose
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    ik_samples: u32,
}

/// The figures of one plan that the table shows; the planner writes more.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct PlanFigures {
    /// Scanned points.
    pub points: usize,
    /// Patches.
    pub patches: usize,
    /// Patches that the arm reaches.
    pub reachable: usize,
    /// Sum of all joint displacements. \[rad\]
    pub effort_rad: f64,
    /// \[s\]
    pub task_time_s: f64,
    /// Seconds that planning took.
    pub calc_time_total_s: f64,
    /// Knots.
    pub knots: usize,
    /// Motions through free space.
    pub jumps: usize,
    /// Share of all scanned points, with what was swept before.
    pub coverage_all: f64,
    /// Share of the points of reachable patches, with what was swept before.
    pub coverage_reachable: f64,
    /// \[m\]
    pub line_deviation_max_m: f64,
}

/// A plan as it was asked for and came out.
#[derive(Clone, Debug, Serialize)]
pub struct Planned {
    /// How the order was found.
    pub method: &'static str,
    /// What was minimised.
    pub cost: &'static str,
    /// Its figures.
    pub figures: PlanFigures,
}

/// Where and how the second plan took over.
#[derive(Clone, Debug, Serialize)]
pub struct Swap {
    /// The first plan's knot.
    pub knot: usize,
    /// Its time in the first plan. \[s\]
    pub at_s: f64,
    /// The first plan's knot when the second one was accepted.
    pub accepted_at_knot: u32,
    /// The largest step of a joint in the cycle of the swap, as a share of v·T, where it is judged.
    pub step_ratio: Option<f64>,
    /// The largest change of a joint's velocity there. \[rad/s\]
    pub velocity_step: Option<f64>,
}

/// What is asked of a run, and whether it came true.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// What.
    pub what: &'static str,
    /// Whether.
    pub ok: bool,
    /// The figures behind it.
    pub found: String,
}

/// Everything that the demo tells.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// What stood in for the robot.
    pub hardware: Hardware,
    /// How fast the plans went along their paths.
    pub profile: Profile,
    /// Both plans.
    pub plans: [Planned; 2],
    /// The swap.
    pub swap: Swap,
    /// Setpoints that the mock judged, and violations among them.
    pub judged: Option<[u64; 2]>,
    /// What the endpoint itself did.
    pub endpoint: Deeds,
    /// How the arm followed.
    pub tracking: Tracking,
    /// What the measured positions have swept.
    pub measured: Swept,
    /// Wake-up lateness of the executor.
    pub lateness: Percentiles,
    /// Deadlines that it missed.
    pub missed_cycles: u64,
    /// The report's path.
    pub report: PathBuf,
    /// The picture's path.
    pub picture: Option<PathBuf>,
    /// How long all of it took. \[s\]
    pub seconds: f64,
    /// What must be so.
    pub checks: Vec<Check>,
}

/// Runs with the arguments of a command line, program name first; with a hidden first argument
/// the program plays another part, see [`parts`].
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Vec<_> = args.into_iter().collect();
    if let Some(code) = parts::play(&args) {
        return code;
    }
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        Err(error) => error.exit(),
    };
    match run(&args) {
        Ok(outcome) if outcome.checks.iter().all(|c| c.ok) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("demo: {error:#}");
            ExitCode::from(if error.is::<Missing>() { Missing::CODE } else { 2 })
        }
    }
}

fn run(args: &Args) -> anyhow::Result<Outcome> {
    args.hardware.check(args)?;
    let stage = Stage::new(std::env::current_exe()?, "pr2")?;
    let outcome = perform(args, &stage);
    if let Some(folder) = &args.keep {
        stage.copy_files(folder).with_context(|| format!("cannot fill {}", folder.display()))?;
    }
    let outcome = outcome?;
    match &args.json {
        Some(path) if path.as_os_str() == "-" => {
            println!("{}", serde_json::to_string_pretty(&outcome)?);
        }
        Some(path) => {
            let file = File::create(path)
                .with_context(|| format!("cannot write the figures to {}", path.display()))?;
            serde_json::to_writer_pretty(file, &outcome)?;
            println!("{}", table::text(&outcome));
        }
        None => println!("{}", table::text(&outcome)),
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
    // Mid-motion: the arm is on the surface or on its way there, and the knot is still ahead.
    let early = 0.3 * at_s * 1e9;
    system.until(|w| w.see("motion", |t| t.plan == old && t.plan_time_ns as f64 > early))?;
    say("publishing the second plan while the arm moves");
    let mut publisher = start_publish(stage, "second", &["--wait"])?;
    let (new, accepted) = system.until(|w| accepted(w, old))?;
    let patience = Duration::from_secs_f64(60.0 + 3.0 * second.figures.task_time_s);
    finish(&mut publisher, patience)?;
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

/// What must be so.
fn checks(outcome: &Outcome, swapped: bool) -> Vec<Check> {
    let Outcome { swap, endpoint, tracking, measured, .. } = outcome;
    let planned = outcome.plans[1].figures.coverage_reachable;
    let mut checks = vec![Check {
        what: "the second plan took over mid-motion and ran to its end",
        ok: swapped && (swap.accepted_at_knot as usize) < swap.knot,
        found: format!("accepted in knot {}, joined in knot {}", swap.accepted_at_knot, swap.knot),
    }];
    if let Some([setpoints, violations]) = outcome.judged {
        checks.push(Check {
            what: "the endpoint saw no violation",
            ok: violations == 0 && setpoints > 0 && swap.step_ratio.is_some(),
            found: format!("{violations} of {setpoints}"),
        });
    }
    if let (Some(step), Profile::Acceleration) = (swap.velocity_step, outcome.profile) {
        checks.push(Check {
            what: "no jump of the velocity at the swap",
            ok: step <= SWAP_VELOCITY_STEP,
            found: format!("{step:.4} rad/s"),
        });
    }
    checks.push(Check {
        what: "the endpoint refused no setpoint",
        ok: endpoint.refused == 0,
        found: format!("{} refused", endpoint.refused),
    });
    // Bang-bang velocity makes any arm with a mass lag; the figure is told, no more.
    if outcome.profile == Profile::Acceleration {
        checks.push(Check {
            what: "the arm follows",
            ok: tracking.p95 <= TRACKING_P95,
            found: format!("p95 {:.4} rad", tracking.p95),
        });
    }
    checks.push(Check {
        what: "what was measured covers what was planned",
        ok: measured.reachable >= planned - COVERAGE_SLACK,
        found: format!("{:.1} % for {:.1} %", 100.0 * measured.reachable, 100.0 * planned),
    });
    for (what, path) in [
        ("the report is there", Some(&outcome.report)),
        ("the picture is there", outcome.picture.as_ref()),
    ] {
        checks.extend(path.map(|path| Check {
            what,
            ok: fs::metadata(path).is_ok_and(|m| m.len() > 0),
            found: path.display().to_string(),
        }));
    }
    checks
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
    finish(&mut planner, PLANNING)?;
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
    finish(&mut start_publish(stage, name, more)?, patience)
}

/// Waits for a process that must end well.
fn finish(process: &mut Process, patience: Duration) -> anyhow::Result<()> {
    match process.wait(patience)? {
        Some(status) if status.success() => Ok(()),
        Some(status) => {
            bail!("{} failed ({status}): {}", process.name(), process.last_words())
        }
        None => bail!("{} did not end within {} s", process.name(), patience.as_secs()),
    }
}

/// The plan that was answered after `old` began, and the telemetry of that moment.
fn accepted(witness: &mut Witness, old: PlanId) -> Result<(PlanId, Telemetry), WitnessError> {
    let answers = [EventKind::Accepted, EventKind::Rejected].map(EventKind::wire);
    witness.until("an answer to the second plan".into(), |w| {
        let event = w.events().iter().find(|e| e.plan != old && answers.contains(&e.kind))?;
        Some((event.plan, *w.telemetry()?))
    })
}
