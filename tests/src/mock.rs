//! `mock-hardware`: a simulated arm as a process of its own, and the judge of what it is told.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Parser;
use clap::builder::ArgPredicate;
use comfy_table::{Table, presets};
use nullsweep_cell::causes;
use nullsweep_executor::log::last_words;
use nullsweep_executor::rt::become_real_time;
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::service;
use nullsweep_planner::link::Post;
use nullsweep_planner::plan::Plan;
use nullsweep_robot::{Arm, JointVector};
use serde::Serialize;
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::arm_args::{ArmArgs, initial_posture};
use crate::clock::Grid;
use crate::endpoint::{Behaviour, Counters, Endpoint, Fidelity};
use crate::fault::FaultAt;
use crate::judge::{Rules, Verdict};
use crate::measured::{Swept, swept};
use crate::record::Recorder;
use crate::tracking::Tracking;
use crate::whole;

const PERIOD_NS: u64 = 1_000_000;

/// A simulated arm behind the setpoint and state services, which judges every setpoint.
///
/// Ends on SIGTERM, SIGINT or after --seconds, prints its verdict, and exits with 0 only if there
/// was no violation.
#[derive(Debug, Parser)]
#[command(name = "mock-hardware", version)]
// Where a plan says how the arm stands, a cell does not.
#[command(mut_arg("held", |held| held.default_value_if("plan", ArgPredicate::IsPresent, None)))]
struct Args {
    #[command(flatten)]
    arm: ArmArgs,
    /// Stand where this plan begins (unless told otherwise), and measure what is swept of its
    /// surface
    #[arg(long, value_name = "FILE")]
    plan: Option<PathBuf>,
    /// Be the whole robot that this program was made for: a base that drives, and the program's arms, each
    /// behind the services of an executor of its own. Measures what they sweep together
    #[arg(long, value_name = "FILE", conflicts_with_all = ["plan", "initial", "record", "seconds"])]
    program: Option<PathBuf>,
    /// With --program: the robot's name of an arm's services, as in left=pr2-left; of each, where the
    /// program has several
    #[arg(long, value_name = "ARM=NAME", requires = "program")]
    executor: Vec<Post>,
    /// With --program: where the base stands at first, x,y,yaw in m and rad
    #[arg(
        long,
        value_parser = place,
        allow_hyphen_values = true,
        value_name = "X,Y,YAW",
        requires = "program"
    )]
    stands: Option<[f64; 3]>,
    /// With --program: how far off its goal the base ends each drive, x,y,yaw in m and rad
    #[arg(
        long,
        value_parser = place,
        allow_hyphen_values = true,
        value_name = "X,Y,YAW",
        requires = "program"
    )]
    base_off: Option<[f64; 3]>,
    /// Where the joints stand at first, base to tip; without it, the arm's home, in rad
    #[arg(
        long,
        value_delimiter = ',',
        allow_negative_numbers = true,
        value_name = "Q1,Q2,…",
        default_value_if("plan", ArgPredicate::IsPresent, None)
    )]
    initial: Vec<f64>,
    /// How true to a robot the arm is
    #[arg(long, value_enum, default_value_t)]
    fidelity: Fidelity,
    /// With --fidelity mechanism: effort on the shoulder lift of a weight in the hand, in N·m
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_name = "NM")]
    payload: f64,
    /// Tell the angles of continuous joints in (−π, π]
    #[arg(long)]
    wrap: bool,
    /// End after so many seconds
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// A fault to play, as in halt@3s or stale@2s+300ms; may be given several times
    #[arg(long, value_name = "KIND@START[+LENGTH]")]
    fault: Vec<FaultAt>,
    /// Stop by itself so long after the last setpoint's deadline, in ms
    #[arg(long, default_value_t = 20, value_name = "MS")]
    timeout: u64,
    /// SCHED_FIFO priority of the mock's loop, where permitted; 0 for the default scheduler
    #[arg(long, default_value_t = 70, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Write the measured and commanded joints as CSV
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Time between two recorded measurements, in ms
    #[arg(long, default_value_t = 5, value_name = "MS")]
    record_every: u64,
    /// Write the verdict as JSON, to a file or to standard output with -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

/// What a run of the mock found.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Name of the robot in the services' names.
    pub robot: String,
    /// How long it ran. \[s\]
    pub seconds: f64,
    /// Number of violations of all kinds.
    pub violations: u64,
    /// The judge's findings.
    pub verdict: Verdict,
    /// What the endpoint itself did.
    pub endpoint: Counters,
    /// Cycles of the mock's own loop that began more than one period late.
    pub own_late_cycles: u64,
    /// What the measured positions have swept, where a plan was given.
    pub swept: Option<Swept>,
    /// How the arm followed, where a plan ran.
    pub tracking: Option<Tracking>,
}

/// Runs the mock with the arguments of a command line, program name first.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Args = match nullsweep_cell::parse(args, &[("", &["record", "priority"])], &[]) {
        Ok(args) => args,
        Err(error) => error.exit(),
    };
    let violations = match &args.program {
        Some(program) => run_whole(&args, program),
        None => run(&args).map(|outcome| outcome.violations),
    };
    match violations {
        Ok(0) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            last_words(&format!("mock-hardware: {}", causes(error.as_ref())));
            ExitCode::from(2)
        }
    }
}

/// Asked to end: by SIGTERM or SIGINT.
fn ending() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGTERM, SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

fn place(text: &str) -> Result<[f64; 3], String> {
    let values: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    let values = values.map_err(|e| format!("{e}: x,y,yaw is wanted"))?;
    let finite = values.iter().all(|value| value.is_finite());
    let three = values.try_into().map_err(|_| "three numbers are wanted: x,y,yaw".to_owned())?;
    if finite { Ok(three) } else { Err("finite numbers are wanted".into()) }
}

fn behaviour(args: &Args) -> Behaviour {
    let session_timeout_ns = args.timeout.saturating_mul(1_000_000);
    Behaviour {
        fidelity: args.fidelity,
        payload: args.payload,
        wrap: args.wrap,
        rules: Rules { session_timeout_ns, ..Rules::default() },
        faults: args.fault.clone(),
    }
}

/// Is the whole robot; how many violations there were.
fn run_whole(args: &Args, program: &Path) -> anyhow::Result<u64> {
    let config = whole::Config {
        program: program.into(),
        robot: args.arm.robot()?,
        robot_name: args.arm.robot_name.clone(),
        ipc_root: args.arm.ipc_root.clone(),
        posts: args.executor.clone(),
        base: args.stands.unwrap_or_default(),
        off: args.base_off.unwrap_or_default(),
        behaviour: behaviour(args),
        every_ns: args.record_every.max(1) * 1_000_000,
        priority: args.priority,
    };
    let outcome = whole::run(&config, &ending()?)?;
    tell(args, &outcome, &whole::table(&outcome))?;
    Ok(outcome.violations)
}

fn run(args: &Args) -> anyhow::Result<Outcome> {
    let plan = match &args.plan {
        Some(path) => Some(Plan::read(path).context("--plan")?),
        None => None,
    };
    let (arm, initial) = scene(args, plan.as_ref())?;
    let stop = ending()?;

    let ipc = Ipc::open(&args.arm.robot_name, args.arm.ipc_root.as_deref())?;
    let setpoints = ipc.setpoint_receiver()?;
    let states = ipc.state_sender()?;
    // Nobody need read it.
    last_words(&format!(
        "mock-hardware: arm {} with {} joints is ready as robot `{}`",
        args.arm.arm,
        arm.dof(),
        args.arm.robot_name
    ));

    let start_ns = now_ns();
    let mut endpoint = Endpoint::new(&arm, initial, behaviour(args), start_ns)?;
    let mut recorder = Recorder::new(args.record_every.max(1) * 1_000_000);
    let end_ns = args.seconds.map(|s| start_ns + Duration::from_secs_f64(s).as_nanos() as u64);

    let mut pass = Vec::with_capacity(2 * service::SETPOINT.buffer);
    let mut newest = None;
    // Where it is denied the mock is only later now and then, and says how often.
    let _ = become_real_time(args.priority, None);
    let mut grid = Grid::new(PERIOD_NS);
    let mut own_late_cycles = 0;
    let mut now = start_ns;
    while !stop.load(Ordering::Relaxed) && end_ns.is_none_or(|end| now < end) {
        let tick = grid.wait();
        now = tick.now_ns;
        own_late_cycles += u64::from(tick.skipped > 0);
        pass.clear();
        // At most one buffer and what comes meanwhile: a fast sender cannot hold the loop.
        while pass.len() < pass.capacity()
            && let Some(setpoint) = setpoints.receive()?
        {
            pass.push(setpoint);
        }
        endpoint.receive(&pass, now);
        newest = pass.last().copied().or(newest);
        if let Some(state) = endpoint.measure(now) {
            states.send(&state)?;
        }
        recorder.offer(now, endpoint.positions(), newest.as_ref());
    }

    let outcome = Outcome {
        robot: args.arm.robot_name.clone(),
        seconds: (now - start_ns) as f64 * 1e-9,
        violations: endpoint.judge().verdict().total(),
        verdict: endpoint.judge().verdict().clone(),
        endpoint: endpoint.counters(),
        own_late_cycles,
        swept: plan.as_ref().map(|plan| swept(plan, &arm, recorder.postures())),
        tracking: recorder.tracking(&arm),
    };
    if let Some(path) = &args.record {
        let file = File::create(path)
            .with_context(|| format!("cannot write the record to {}", path.display()))?;
        let mut out = BufWriter::new(file);
        recorder.write_csv(arm.joint_names(), &mut out)?;
        out.flush()?;
    }
    tell(args, &outcome, &table(&outcome))?;
    Ok(outcome)
}

/// The arm with its held joints, and where it stands at first.
fn scene(args: &Args, plan: Option<&Plan>) -> anyhow::Result<(Arm, JointVector)> {
    let Some(plan) = plan else {
        let arm = args.arm.load()?;
        let initial = initial_posture(&arm, &args.initial)?;
        return Ok((arm, initial));
    };
    let mut options = args.arm.clone();
    // What is given on the command line comes later and so wins.
    let planned = plan.held.iter().map(|h| (h.name.clone(), h.position));
    options.held = planned.chain(args.arm.held.iter().cloned()).collect();
    let arm = options.load()?;
    if arm.fingerprint() != plan.fingerprint {
        bail!("the plan was made for another arm than {} of this robot", args.arm.arm);
    }
    let first = plan.knots.first().context("the plan has no knots")?.q;
    let first = &first[..arm.dof()];
    let initial =
        initial_posture(&arm, if args.initial.is_empty() { first } else { &args.initial })?;
    Ok((arm, initial))
}

fn tell(args: &Args, outcome: &impl Serialize, table: &str) -> anyhow::Result<()> {
    match &args.json {
        Some(path) if path.as_os_str() == "-" => {
            serde_json::to_writer_pretty(io::stdout().lock(), outcome)?;
            println!();
        }
        Some(path) => {
            let file = File::create(path)
                .with_context(|| format!("cannot write the verdict to {}", path.display()))?;
            serde_json::to_writer_pretty(file, outcome)?;
            println!("{table}");
        }
        None => println!("{table}"),
    }
    Ok(())
}

fn table(outcome: &Outcome) -> String {
    let verdict = &outcome.verdict;
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(["mock hardware", outcome.robot.as_str()]);
    let mut row = |what: &str, value: String| {
        table.add_row([what.to_owned(), value]);
    };
    row("time", format!("{:.1} s", outcome.seconds));
    row("setpoints", format!("{} in {} sessions", verdict.setpoints, verdict.sessions));
    row("violations", outcome.violations.to_string());
    for (kind, count) in verdict.violations.iter().filter(|(_, count)| **count > 0) {
        row(&format!("  {kind}"), count.to_string());
    }
    row("largest step", format!("{:.1} % of v·T", 100.0 * verdict.largest_step_ratio));
    if verdict.least_margin.is_finite() {
        row("least margin to a limit", format!("{:.4}", verdict.least_margin));
    }
    row("lost by this reader", verdict.lost_by_reader.to_string());
    row(
        "made late by the sender",
        format!("{}, at most {:.1} ms", verdict.late, verdict.worst_lateness_ns as f64 * 1e-6),
    );
    row("own late cycles", outcome.own_late_cycles.to_string());
    row("stopped by itself", format!("{} times", outcome.endpoint.timeouts));
    row("refused setpoints", outcome.endpoint.refused.to_string());
    if let Some(swept) = &outcome.swept {
        row("swept of reachable points", format!("{:.2} %", 100.0 * swept.reachable));
        row("swept of all points", format!("{:.2} %", 100.0 * swept.all));
    }
    if let Some(Tracking { p50, p95, max }) = outcome.tracking {
        row("tracking error", format!("p50 {p50:.4}, p95 {p95:.4}, max {max:.4} rad"));
    }
    for run in verdict.plans.iter().filter(|run| run.plan != "0/0") {
        row(
            &format!("plan {}", run.plan),
            format!("setpoints {} … {}", run.first_sequence, run.last_sequence),
        );
    }
    let mut text = table.to_string();
    for violation in &verdict.first {
        text.push_str("\n  ");
        text.push_str(&violation.to_string());
    }
    if verdict.setpoints == 0 {
        text.push_str("\nno setpoint came: is an executor running for this robot?");
    }
    text
}
