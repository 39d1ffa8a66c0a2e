//! The command line: `executor run`, `executor replay`; `executor ctl` is next door.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand};
use nullsweep_cell::{as_called, causes};
use nullsweep_ipc_types::{HISTOGRAM_BUCKETS, bucket_upper_ns};
use nullsweep_robot::{Arm, ArmSpec, Robot};

use crate::alarm::Alarm;
use crate::ctl::{self, CtlArgs};
use crate::executor::{Config, Summary, quantile_ns, run};
use crate::guard::Guard;
use crate::log::{Log, last_words};
use crate::pidfile::{PidFile, PidFileError};
use crate::record::replay;
use crate::rt::probe_cpu;
use crate::system::SystemArgs;
use crate::top::{TopArgs, top};

/// Real-time executor: streams joint setpoints of published plans to a hardware endpoint.
#[derive(Debug, Parser)]
#[command(
    name = "executor",
    version,
    after_help = "Exit codes: 0 done, or ended by a signal as asked; 1 failed, or a command was not accepted; 2 wrong usage."
)]
struct Cli {
    #[command(subcommand)]
    command: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Run until SIGINT or SIGTERM, then stop on the path and disable the motors. SIGUSR1 stops on
    /// the path, SIGUSR2 also disables the motors.
    Run(Box<RunArgs>),
    /// Send a command to a running executor.
    Ctl(CtlArgs),
    /// Watch a running executor on a live screen; keys pause, resume, stop and change the speed.
    Top(TopArgs),
    /// Replay a flight recording and compare every setpoint bit for bit.
    Replay {
        /// A file that `run --record` wrote.
        file: PathBuf,
    },
}

#[derive(Debug, Args)]
struct RunArgs {
    #[command(flatten)]
    system: SystemArgs,
    /// The robot; the embedded PR2 where not given. Its limits are the ones that are enforced.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// The arm: `right` or `left` of the PR2, else its base and tip link, BASE,TIP.
    #[arg(long, value_name = "ARM", default_value = "right")]
    arm: ArmSpec,
    /// Cycles a second.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(50..=4000))]
    rate: u32,
    /// Pin the loop to this CPU.
    #[arg(long)]
    cpu: Option<usize>,
    /// SCHED_FIFO priority of the loop; the other threads get one of at most 5. 0 leaves all to
    /// the default scheduler.
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Rehearse and spin the last microseconds before each deadline, where SCHED_FIFO is granted.
    /// Default: 100, or 0 on a single core.
    #[arg(long, value_parser = clap::value_parser!(u32).range(0..=500))]
    spin_us: Option<u32>,
    /// Stop on the path when the joint state is older than this.
    #[arg(long, default_value_t = 20.0)]
    stale_ms: f64,
    /// Fault when the joint state is older than this.
    #[arg(long, default_value_t = 100.0)]
    lost_ms: f64,
    /// Fault when the mean rate over 600 ms is below this share of the rate.
    #[arg(long, default_value_t = 0.75)]
    min_rate: f64,
    /// How far a plan's first knot may be from where the arm holds. [rad]
    #[arg(long, default_value_t = Guard::START_TOLERANCE)]
    start_tolerance: f64,
    /// How far a held joint (torso, other arm) may be from where a plan takes it; as far again it may
    /// move while the plan runs. Plans keep 5 mm clear: both together should stay below. [rad or m]
    #[arg(long, default_value_t = Guard::HELD_TOLERANCE)]
    held_tolerance: f64,
    /// Following error that is allowed at stand-still. [rad]
    #[arg(long, default_value_t = 0.1)]
    following_error: f64,
    /// Following error that is allowed for each unit of commanded speed. [s]
    #[arg(long, default_value_t = 0.15)]
    following_lag: f64,
    /// How far the arm may be from a plan's last knot for the plan to be finished. [rad or m]
    #[arg(long, default_value_t = Guard::GOAL_TOLERANCE)]
    goal_tolerance: f64,
    /// How long it may take to come to rest there before the plan is aborted instead.
    #[arg(long, default_value_t = 1000.0)]
    goal_ms: f64,
    /// Acceleration of stops, pauses and changes of speed along the path, each joint. [rad/s²]
    #[arg(long, default_value_t = 10.0)]
    stop_acceleration: f64,
    /// Folder for the flight recorder: two files that take turns; those of the run before stay as
    /// before-0 and before-1.
    #[arg(long, value_name = "FOLDER")]
    record: Option<PathBuf>,
    /// Size of each of them; 1 MiB holds about 2.5 s.
    #[arg(long, default_value_t = 256, value_parser = clap::value_parser!(u64).range(1..))]
    record_mib: u64,
}

/// The command line was wrong: ends with clap's own code.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// The program: parses the arguments (the first one is the program's name), does what they say,
/// and reports errors. Another program can call it to be an executor, given that it installs
/// [`crate::PoolAllocator`] as its allocator.
pub fn main_with<I, T>(args: I) -> ExitCode
where
    I: IntoIterator<Item = T>,
    T: Into<OsString>,
{
    let cli: Cli = match nullsweep_cell::parse(args, &[], &["ctl"]) {
        Ok(cli) => cli,
        Err(e) => {
            let _ = e.print();
            return ExitCode::from(u8::try_from(e.exit_code()).unwrap_or(2));
        }
    };
    let result = match cli.command {
        Action::Run(args) => run_command(&args),
        Action::Ctl(args) => ctl::command(&args),
        Action::Top(args) => arm(args.urdf.as_deref(), &args.arm)
            .and_then(|arm| top(&args, &arm).context("the screen")),
        Action::Replay { file } => replay_command(&file),
    };
    match result {
        Ok(code) => code,
        // Whoever reads the output has read enough.
        Err(e) if e.chain().any(is_broken_pipe) => ExitCode::from(BROKEN_PIPE),
        Err(e) => {
            last_words(&as_called(format!("executor: {}", causes(e.as_ref()))));
            ExitCode::from(if e.is::<Usage>() { 2 } else { 1 })
        }
    }
}

/// The exit code where nobody reads what is written any more: as a shell tells a signal.
const BROKEN_PIPE: u8 = 128 + 13;

fn is_broken_pipe(cause: &(dyn std::error::Error + 'static)) -> bool {
    let error = cause.downcast_ref::<std::io::Error>();
    error.is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

fn run_command(args: &RunArgs) -> anyhow::Result<ExitCode> {
    let log = Log::install("info");
    let result = run_logged(args, log.lost());
    log.end();
    result
}

fn run_logged(args: &RunArgs, lost_lines: Arc<AtomicU64>) -> anyhow::Result<ExitCode> {
    let alarm = Alarm::install()?;
    let arm = arm(args.urdf.as_deref(), &args.arm)?;
    let config = Config { lost_lines, ..config(args, &arm)? };
    tracing::info!(
        "executor for robot `{}`: {} joints from {} to {}, {} Hz, process {}",
        config.robot_name,
        arm.dof(),
        arm.spec().base,
        arm.spec().tip,
        args.rate,
        std::process::id()
    );
    // After the handlers: who finds the file may send signals.
    let _here = match PidFile::claim(&config.robot_name, config.ipc_root.as_deref()) {
        Ok(file) => Some(file),
        Err(e @ PidFileError::Taken { .. }) => return Err(e.into()),
        Err(e @ PidFileError::Write { .. }) => {
            tracing::warn!("`ctl stop` needs --pid {}: {e}", std::process::id());
            None
        }
    };
    let summary = run(&arm, &config, &alarm)?;
    tracing::info!("{}", Told(summary));
    Ok(ExitCode::SUCCESS)
}

fn arm(urdf: Option<&Path>, arm: &ArmSpec) -> anyhow::Result<Arm> {
    let robot = match urdf {
        Some(path) => Robot::from_urdf_file(path)
            .with_context(|| format!("cannot read the robot from {}", path.display()))?,
        None => Robot::pr2(),
    };
    robot.arm(arm).with_context(|| format!("arm {arm} of robot `{}`", robot.name()))
}

fn config(args: &RunArgs, arm: &Arm) -> anyhow::Result<Config> {
    let positive = |name: &str, value: f64| {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            bail!(Usage(format!("{name} must be a positive number, not {value}")))
        }
    };
    let from_zero = |name: &str, value: f64, most: f64| {
        if (0.0..=most).contains(&value) {
            Ok(value)
        } else {
            bail!(Usage(format!("{name} must be from 0 to {most}, not {value}")))
        }
    };
    let nanos = |name: &str, ms: f64| positive(name, ms).map(|ms| (ms * 1e6) as u64);
    let rate = f64::from(args.rate);
    let guard = Guard {
        period_ns: 1_000_000_000 / u64::from(args.rate),
        stop_acceleration: positive("--stop-acceleration", args.stop_acceleration)?,
        start_tolerance: positive("--start-tolerance", args.start_tolerance)?,
        stale_ns: nanos("--stale-ms", args.stale_ms)?,
        lost_ns: nanos("--lost-ms", args.lost_ms)?,
        held_drift: positive("--held-tolerance", args.held_tolerance)?,
        following_error: positive("--following-error", args.following_error)?,
        following_lag: from_zero("--following-lag", args.following_lag, 10.0)?,
        goal_tolerance: positive("--goal-tolerance", args.goal_tolerance)?,
        goal_ns: nanos("--goal-ms", args.goal_ms)?,
        min_rate: from_zero("--min-rate", args.min_rate, 1.0)? * rate,
        ..Guard::new(arm.limits())
    };
    if guard.lost_ns < guard.stale_ns {
        bail!(Usage("--lost-ms must not be below --stale-ms".into()));
    }
    if let Some(cpu) = args.cpu {
        probe_cpu(cpu).map_err(|why| Usage(format!("--cpu {cpu}: {why}")))?;
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let spin_us = args.spin_us.unwrap_or(if cores > 1 { 100 } else { 0 });
    Ok(Config {
        robot_name: args.system.robot_name.clone(),
        ipc_root: args.system.ipc_root.clone(),
        guard,
        held_tolerance: positive("--held-tolerance", args.held_tolerance)?,
        priority: args.priority,
        cpu: args.cpu,
        spin_ns: u64::from(spin_us) * 1000,
        record: args.record.clone().map(|folder| (folder, args.record_mib << 20)),
        lost_lines: Arc::default(),
    })
}

fn replay_command(file: &Path) -> anyhow::Result<ExitCode> {
    let replayed = replay(file)?;
    let mut out = std::io::stdout().lock();
    for (cycle, event) in &replayed.events {
        writeln!(out, "cycle {cycle}: {event}")?;
    }
    writeln!(
        out,
        "{} cycles, {} setpoints, all bit-identical; {} bytes of a torn record left out",
        replayed.cycles, replayed.setpoints, replayed.torn
    )?;
    Ok(ExitCode::SUCCESS)
}

/// A quantile in words.
fn below(histogram: &[u32; HISTOGRAM_BUCKETS], share: f64) -> String {
    match quantile_ns(histogram, share) {
        Some(bound) => format!("< {:.1} µs", bound as f64 * 1e-3),
        None => format!("> {:.1} µs", bucket_upper_ns(HISTOGRAM_BUCKETS - 2) as f64 * 1e-3),
    }
}

/// A summary in words.
struct Told(Summary);

impl std::fmt::Display for Told {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let s = &self.0;
        write!(
            f,
            "{} cycles, {} deadlines missed; armed for {} cycles: {} system-heap calls, {} page \
             faults; {} blocks from its own pool; {} port failures; wake-up lateness p50 {}, p99 \
             {}, p99.9 {}; compute time p50 {}, p99 {}, p99.9 {}",
            s.cycles,
            s.missed,
            s.armed_cycles,
            s.heap_calls,
            s.page_faults,
            s.pool_calls,
            s.failures,
            below(&s.lateness, 0.5),
            below(&s.lateness, 0.99),
            below(&s.lateness, 0.999),
            below(&s.compute, 0.5),
            below(&s.compute, 0.99),
            below(&s.compute, 0.999),
        )
    }
}
