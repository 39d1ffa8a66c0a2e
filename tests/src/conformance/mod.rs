//! `conformance`: does an endpoint keep what the executor relies on? One suite for every
//! [`Hardware`]: the mock in this process under a virtual clock, the mock as a process, and
//! whatever controller a user wants to put behind the setpoint and state services.

mod checks;
mod rig;

use std::ffi::OsString;
use std::fs::File;
use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use clap::Parser;
use comfy_table::{Table, presets};
use nullsweep_executor::rt::become_real_time;
use nullsweep_executor::{Hardware, IpcHardware};
use nullsweep_ipc_types::ports::Ipc;
use serde::Serialize;

use crate::arm_args::ArmArgs;
use crate::clock::Grid;

pub use checks::{Broken, Check, Terms, checks};
pub use rig::{Clock, Rig, VirtualClock, VirtualEndpoint};

/// How long an endpoint may take to send its first state.
const APPEARS_WITHIN: Duration = Duration::from_secs(3);

/// Tries an endpoint in the executor's place, rule by rule.
///
/// THE ARM MOVES: each joint by --angle and back. Keep a hand on the run stop. Ends with 0 if every
/// rule is kept, 1 if one is broken, 2 if it could not be tried: no endpoint, or wrong usage.
#[derive(Debug, Parser)]
#[command(name = "conformance", version)]
struct Args {
    #[command(flatten)]
    arm: ArmArgs,
    /// How far each joint is moved, in rad
    #[arg(long, default_value_t = Terms::default().angle)]
    angle: f64,
    /// How fast, as a share of its velocity limit
    #[arg(long, default_value_t = Terms::default().speed)]
    speed: f64,
    /// How soon after the last setpoint's deadline it must stop and say so, in ms
    #[arg(long, default_value_t = Terms::default().grace_ms, value_name = "MS")]
    grace: u64,
    /// How soon its motors must be on again once a disable is taken back, in ms
    #[arg(long, default_value_t = Terms::default().power_ms, value_name = "MS")]
    power: u64,
    /// How far the arm may be from its setpoint at rest, in rad
    #[arg(long, default_value_t = Terms::default().tolerance)]
    tolerance: f64,
    /// Leave out the rules whose trial moves the arm
    #[arg(long)]
    still: bool,
    /// Try as well whether setpoints are refused that no executor sends: from afar after a stop,
    /// and nonsense. An endpoint that does not refuse them JUMPS by three times --tolerance
    #[arg(long)]
    dare: bool,
    /// SCHED_FIFO priority, where permitted; 0 for the default scheduler
    #[arg(long, default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Write what was found as JSON, to a file or to standard output with -
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
}

/// What was found of one rule.
#[derive(Clone, Debug, Serialize)]
pub struct Finding {
    /// The rule's name.
    pub name: &'static str,
    /// What it asks.
    pub asks: &'static str,
    /// Why it is broken, `None` where it is kept.
    pub broken: Option<String>,
}

/// Tries every rule that `wanted` picks.
pub fn suite<H: Hardware, C: Clock>(
    rig: &mut Rig<H, C>,
    terms: &Terms,
    wanted: impl Fn(&Check<H, C>) -> bool,
) -> Vec<Finding> {
    let mut found = Vec::new();
    for check in checks().into_iter().filter(wanted) {
        let broken = (check.run)(rig, terms).err().map(|b| b.to_string());
        found.push(Finding { name: check.name, asks: check.asks, broken });
    }
    found
}

/// Runs with the arguments of a command line, program name first.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Args = match nullsweep_cell::parse(args, &[("", &["priority"])], &[]) {
        Ok(args) => args,
        Err(error) => error.exit(),
    };
    match run(&args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("conformance: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Whether every rule is kept.
fn run(args: &Args) -> anyhow::Result<bool> {
    for (name, value) in
        [("--angle", args.angle), ("--speed", args.speed), ("--tolerance", args.tolerance)]
    {
        ensure!(value.is_finite() && value > 0.0, "{name} must be a positive number, not {value}");
    }
    let arm = args.arm.load()?;
    let ipc = Ipc::open(&args.arm.robot_name, args.arm.ipc_root.as_deref())?;
    let mut hardware = IpcHardware::open(&ipc)
        .context("the executor's place is not free: end the executor first")?;
    wait_for_states(&mut hardware, args)?;
    let terms = Terms {
        angle: args.angle,
        speed: args.speed,
        grace_ms: args.grace,
        power_ms: args.power,
        tolerance: args.tolerance,
        ..Terms::default()
    };
    // Where it is denied the rules are tried with more jitter.
    let _ = become_real_time(args.priority, None);
    let mut rig = Rig::new(hardware, Grid::new(rig::PERIOD_NS), &arm);
    let found = suite(&mut rig, &terms, |check| {
        (args.dare || !check.dares) && !(args.still && check.moves)
    });
    match &args.json {
        Some(path) if path.as_os_str() == "-" => {
            println!("{}", serde_json::to_string_pretty(&found)?);
        }
        Some(path) => {
            let file = File::create(path)
                .with_context(|| format!("cannot write to {}", path.display()))?;
            serde_json::to_writer_pretty(file, &found)?;
            println!("{}", table(&found));
        }
        None => println!("{}", table(&found)),
    }
    Ok(found.iter().all(|f| f.broken.is_none()))
}

/// Without any state there is nothing to try: that is no broken rule.
fn wait_for_states(hardware: &mut IpcHardware, args: &Args) -> anyhow::Result<()> {
    let start = Instant::now();
    while start.elapsed() < APPEARS_WITHIN {
        if hardware.read()?.is_some() {
            return Ok(());
        }
        thread::sleep(Duration::from_millis(5));
    }
    let root = args.arm.ipc_root.as_ref();
    let place = root.map_or("the default root path".into(), |r| r.display().to_string());
    bail!(
        "no endpoint sends joint states for robot `{}` under {place}: start it with this \
         --robot-name and --ipc-root first",
        args.arm.robot_name
    )
}

fn table(found: &[Finding]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::UTF8_BORDERS_ONLY);
    table.set_header(["rule", "asks", "found"]);
    for finding in found {
        let verdict = finding.broken.as_deref().unwrap_or("kept");
        table.add_row([finding.name, finding.asks, verdict]);
    }
    table
}
