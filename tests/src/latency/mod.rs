//! The latency lab: how late the executor wakes, how long its setpoints take to the endpoint and
//! a new plan to its first setpoint, beside what the machine does without it, in the same run.

mod baseline;
mod cyclictest;
mod picture;
mod station;
mod stats;

use std::ffi::OsString;
use std::fs::{self, File};
use std::io;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::Parser;
use comfy_table::{CellAlignment, Table, presets};
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::{EventKind, HISTOGRAM_BUCKETS, Mode, PlanId};
use nullsweep_robot::{Arm, ArmSpec, JointVector, MAX_DOF, Robot, Side};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

use crate::clock::sleep_until;
use crate::parts;
use crate::sketch::Sketch;
use crate::stage::{Process, Stage};
use crate::system::start_executor;
use crate::witness::{PATIENCE, Witness};

pub use stats::{Percentiles, Times, of_buckets};

/// Length of the plans that are published. \[s\]
const PLAN_SECONDS: f64 = 0.04;
/// How far their joints go. \[rad\]
const PLAN_ANGLE: f64 = 0.005;
/// Time between two plans: a rest that lets the last one end, and a random part that spreads the
/// moment over the executor's cycle. \[ns\]
const REST_NS: u64 = 180_000_000;
const SPREAD_NS: u64 = 40_000_000;

/// Measures the executor's latencies beside bare yardsticks, in alternating rounds.
#[derive(Debug, Parser)]
#[command(name = "latency", version)]
struct Args {
    /// Seconds for the executor, in all rounds together
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    seconds: f64,
    /// Alternations of yardsticks and executor
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    rounds: u32,
    /// Knots of each plan that is published
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(3..=16384))]
    knots: u32,
    /// SCHED_FIFO priority of executor and yardsticks; 0 for the default scheduler
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Seed of the moments at which plans are published
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Write every figure as JSON, to a file or to standard output with -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Pin executor, bare loop and cyclictest to this processor
    #[arg(long, value_name = "N")]
    cpu: Option<usize>,
    /// Write the distributions as a picture, a page that needs no network
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Options for the executor, after `--`
    #[arg(last = true)]
    executor: Vec<OsString>,
}

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// What was timed.
    pub what: &'static str,
    /// Its percentiles.
    #[serde(flatten)]
    pub times: Percentiles,
}

/// Everything that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Kernel release.
    pub kernel: String,
    /// Whether the kernel calls itself real-time.
    pub realtime_kernel: bool,
    /// Logical processors.
    pub processors: usize,
    /// Load average of the last minute when the run began.
    pub load: String,
    /// Length of the executor's part. \[s\]
    pub seconds: f64,
    /// Seed of the moments of publishing.
    pub seed: u64,
    /// Knots of each published plan.
    pub knots: u32,
    /// The distributions.
    pub rows: Vec<Row>,
    /// Deadlines that the executor missed.
    pub missed_cycles: u64,
    /// Violations that the endpoint's judge found.
    pub violations: u64,
    /// Plans that were published, and those that were accepted.
    pub plans: (usize, usize),
}

/// Sums over all rounds.
#[derive(Default)]
struct Sums {
    sleep: Times,
    cyclictest: Option<Times>,
    ping: Times,
    wake: [u32; HISTOGRAM_BUCKETS],
    compute: [u32; HISTOGRAM_BUCKETS],
    made_late: Times,
    transport: Times,
    inter_arrival: Times,
    swap: Times,
    missed: u64,
    violations: u64,
    published: usize,
    accepted: usize,
}

/// Runs the lab with the arguments of a command line, program name first.
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
        Ok(figures) if figures.violations == 0 => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("latency: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> anyhow::Result<Figures> {
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right))?;
    let load = read("/proc/loadavg").split(' ').next().unwrap_or_default().to_owned();
    let mut sums = Sums::default();
    let mut random = ChaCha8Rng::seed_from_u64(args.seed);
    let share = Duration::from_secs_f64(args.seconds / f64::from(args.rounds));
    for round in 1..=args.rounds {
        eprintln!("latency: round {round} of {}: yardsticks", args.rounds);
        let stage = Stage::new(std::env::current_exe()?, "pr2")?;
        let third = share / 3;
        sums.sleep.merge(&baseline::sleep_loop(third, args.priority, args.cpu));
        if let Some(times) = cyclictest::run(third, args.priority, args.cpu)? {
            sums.cyclictest.get_or_insert_default().merge(&times);
        }
        sums.ping.merge(&baseline::ping(&stage.root(), third, args.priority, args.cpu)?);
        eprintln!("latency: round {round} of {}: executor", args.rounds);
        measure(args, &arm, &stage, share, &mut random, &mut sums)?;
    }
    let figures = figures(args, load, &sums);
    if let Some(path) = &args.report {
        fs::write(path, page(&figures, &sums))
            .with_context(|| format!("cannot write the picture to {}", path.display()))?;
    }
    report(args, &figures)?;
    Ok(figures)
}

/// One round with an executor, an endpoint in this process, and plans at random moments.
fn measure(
    args: &Args,
    arm: &Arm,
    stage: &Stage,
    time: Duration,
    random: &mut ChaCha8Rng,
    sums: &mut Sums,
) -> anyhow::Result<()> {
    let mut options: Vec<OsString> = vec!["--priority".into(), args.priority.to_string().into()];
    if let Some(cpu) = args.cpu {
        options.extend(["--cpu".into(), cpu.to_string().into()]);
    }
    options.extend(args.executor.iter().cloned());
    let mut executor = start_executor(stage, "executor", options)?;
    let (root, done) = (stage.root(), AtomicBool::new(false));
    thread::scope(|scope| {
        let endpoint =
            scope.spawn(|| station::run(arm, stage.robot(), &root, below(args.priority), &done));
        let published = publish(args, arm, stage, &mut executor, time, random, sums);
        done.store(true, Ordering::Relaxed);
        let seen = endpoint.join().map_err(|_| anyhow::anyhow!("the endpoint's thread died"))??;
        let published =
            published.with_context(|| format!("executor: {}", executor.stderr().trim_end()))?;
        executor.terminate(PATIENCE)?;
        sums.transport.merge(&seen.transport);
        sums.inter_arrival.merge(&seen.inter_arrival);
        sums.made_late.merge(&seen.made_late);
        sums.violations += seen.verdict.total();
        for violation in &seen.verdict.first {
            eprintln!("latency: violation: {violation}");
        }
        for plan in published {
            if let Some((_, first_ns)) = seen.first.iter().find(|(id, _)| *id == plan) {
                sums.swap.record(first_ns - plan.epoch);
            }
        }
        Ok(())
    })
}

/// The priority of what must not get in the executor's way.
fn below(priority: u8) -> u8 {
    priority.saturating_sub(1)
}

/// Publishes plans at moments that are drawn in advance, whatever became of the last one; the ids
/// of those that were accepted.
fn publish(
    args: &Args,
    arm: &Arm,
    stage: &Stage,
    executor: &mut Process,
    time: Duration,
    random: &mut ChaCha8Rng,
    sums: &mut Sums,
) -> anyhow::Result<Vec<PlanId>> {
    let ipc = Ipc::open(stage.robot(), Some(&stage.root()))?;
    let mut witness = Witness::open(&ipc)?;
    let held = witness.mode(Mode::Hold)?;
    let mut from = JointVector::default();
    from.copy_from_slice(&held.commanded[..MAX_DOF]);
    let sketch = Sketch::twitch(arm, &from, PLAN_ANGLE, args.knots, PLAN_SECONDS);
    let mut publisher = ipc.plan_publisher(sketch.knots.len())?;
    let mut plans = Vec::new();
    let mut due_ns = now_ns();
    let end_ns = due_ns + time.as_nanos() as u64;
    loop {
        due_ns += REST_NS + random.random_range(0..SPREAD_NS);
        if due_ns >= end_ns {
            break;
        }
        sleep_until(due_ns);
        witness.look()?;
        plans.push(publisher.publish(&sketch.header, &sketch.knots)?);
    }
    if let Some(status) = executor.status()? {
        bail!("the executor ended by itself: {status}");
    }
    for plan in &plans {
        witness.admission(*plan)?;
    }
    let accepted = |plan: &PlanId| {
        let fits = |k: u32, id: PlanId| id == *plan && k == EventKind::Accepted.wire();
        witness.events().iter().any(|e| fits(e.kind, e.plan))
    };
    sums.published += plans.len();
    plans.retain(accepted);
    sums.accepted += plans.len();
    let telemetry = witness.see("a last snapshot", |_| true)?;
    for bucket in 0..HISTOGRAM_BUCKETS {
        sums.wake[bucket] += telemetry.lateness[bucket];
        sums.compute[bucket] += telemetry.compute[bucket];
    }
    sums.missed += telemetry.missed_cycles;
    Ok(plans)
}

fn figures(args: &Args, load: String, sums: &Sums) -> Figures {
    let row = |what, times: &Times| Row { what, times: times.percentiles() };
    Figures {
        kernel: read("/proc/sys/kernel/osrelease"),
        realtime_kernel: read("/sys/kernel/realtime") == "1",
        processors: thread::available_parallelism().map_or(0, usize::from),
        load,
        seconds: args.seconds,
        seed: args.seed,
        knots: args.knots,
        rows: sums
            .cyclictest
            .iter()
            .map(|times| row("cyclictest: wake-up lateness", times))
            .chain([
                row("bare sleep loop: wake-up lateness", &sums.sleep),
                Row { what: "executor: wake-up lateness", times: of_buckets(&sums.wake) },
                Row { what: "executor: compute time", times: of_buckets(&sums.compute) },
                row("executor: setpoint made after due", &sums.made_late),
                row("bare iceoryx2 ping: one way", &sums.ping),
                row("setpoint: stamp to endpoint, with compute", &sums.transport),
                row("setpoint: inter-arrival", &sums.inter_arrival),
                row("publish to first new setpoint", &sums.swap),
            ])
            .collect(),
        missed_cycles: sums.missed,
        violations: sums.violations,
        plans: (sums.published, sums.accepted),
    }
}

fn page(figures: &Figures, sums: &Sums) -> String {
    let mut curves = vec![
        ("executor: wake-up lateness", picture::of_histogram(&sums.wake)),
        ("executor: compute time", picture::of_histogram(&sums.compute)),
        ("bare sleep loop: wake-up lateness", picture::of_times(&sums.sleep)),
        ("setpoint: stamp to endpoint, with compute", picture::of_times(&sums.transport)),
        ("bare iceoryx2 ping: one way", picture::of_times(&sums.ping)),
        ("publish to first new setpoint", picture::of_times(&sums.swap)),
    ];
    curves.extend(
        sums.cyclictest.as_ref().map(|t| ("cyclictest: wake-up lateness", picture::of_times(t))),
    );
    picture::page(&format!("Latencies, kernel {}", figures.kernel), curves)
}

fn report(args: &Args, figures: &Figures) -> anyhow::Result<()> {
    match &args.json {
        Some(path) if path.as_os_str() == "-" => {
            serde_json::to_writer_pretty(io::stdout().lock(), figures)?;
            println!();
            return Ok(());
        }
        Some(path) => {
            let file = File::create(path)
                .with_context(|| format!("cannot write the figures to {}", path.display()))?;
            serde_json::to_writer_pretty(file, figures)?;
        }
        None => {}
    }
    println!("{}", table(figures));
    Ok(())
}

fn table(figures: &Figures) -> String {
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(std::iter::once("µs").chain(Percentiles::HEADS));
    for row in &figures.rows {
        table.add_row(std::iter::once(row.what.to_owned()).chain(row.times.cells()));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let kind = if figures.realtime_kernel { "a real-time kernel" } else { "no real-time kernel" };
    format!(
        "{table}\nkernel {} ({kind}), {} processors, load {} at the start, {} s\n\
         executor histograms are told by the upper bound of their bucket; {} deadlines missed\n\
         {} plans of {} knots at random moments, {} accepted; {} violations at the endpoint",
        figures.kernel,
        figures.processors,
        figures.load,
        figures.seconds,
        figures.missed_cycles,
        figures.plans.0,
        figures.knots,
        figures.plans.1,
        figures.violations,
    )
}

/// A small file of the kernel's, without its line end; empty where it is not there.
fn read(path: &str) -> String {
    fs::read_to_string(path).map(|text| text.trim_end().to_owned()).unwrap_or_default()
}
