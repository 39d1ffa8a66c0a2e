//! `soak`: a laboratory run of minutes or hours at full rate. Plans are swapped in every way,
//! commands come at random, the endpoint fails in turns, clients come and go – and at the end the
//! judge has seen no violation, every plan has had one admission and one end, and executor and mock
//! hold as much memory as when they had warmed up.

mod life;
mod memory;
mod tally;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use clap::Parser;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::fault::FaultKind;
use crate::parts;
use crate::stage::Stage;
use crate::system::{PATIENT, PATIENT_MOCK, System};
use life::Life;
use memory::Memory;

/// Time between two faults of the endpoint, and how long each lasts.
const FAULT_EVERY: Duration = Duration::from_secs(15);
const FAULT_LASTS: Duration = Duration::from_millis(300);
/// Some of the endpoint's faults, which it plays in turns.
const FAULTS: [FaultKind; 10] = [
    FaultKind::Halt,
    FaultKind::Stale,
    FaultKind::Drop,
    FaultKind::Nan,
    FaultKind::Deaf,
    FaultKind::Error,
    FaultKind::Delay,
    FaultKind::Count,
    FaultKind::Freeze,
    FaultKind::Unanswered,
];
/// Share of the run after which memory is to stay as it is, at most [`WARMEST`].
const WARM_UP: f64 = 0.25;
const WARMEST: Duration = Duration::from_secs(120);
/// What a process may grow by from then on. \[KiB\]
const GROWTH: i64 = 1024;

/// Runs the system for a while with much of what can happen to it.
#[derive(Debug, Parser)]
#[command(name = "soak", version)]
struct Args {
    /// How long
    #[arg(long, default_value_t = 60.0, value_name = "MIN")]
    minutes: f64,
    /// Seed of what happens when
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Copy the processes' output to this folder
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

/// Runs with the arguments of a command line, program name first.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Args = match parts::begin(args) {
        Ok(args) => args,
        Err(code) => return code,
    };
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("soak: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> anyhow::Result<()> {
    let length = Duration::try_from_secs_f64(60.0 * args.minutes).context("--minutes")?;
    Stage::with(args.keep.as_deref(), |stage| soak(length, args.seed, stage))
}

fn soak(length: Duration, seed: u64, stage: &Stage) -> anyhow::Result<()> {
    let mock = PATIENT_MOCK.map(String::from).into_iter().chain(faults(length));
    let system = System::start(stage, mock, PATIENT)?;
    let watched = [("executor", system.executor.id()), ("mock", system.endpoint.id())];
    let mut memory = watched.map(|(name, id)| Memory::of(name, id));
    let mut life = Life::new(stage, system, ChaCha8Rng::seed_from_u64(seed))?;
    let start = Instant::now();
    let warm = length.mul_f64(WARM_UP).min(WARMEST);
    let mut told = 0;
    while start.elapsed() < length {
        life.go_on().with_context(|| format!("after {:.1?}: {life}", start.elapsed()))?;
        for memory in &mut memory {
            memory.look(start.elapsed() > warm)?;
        }
        if start.elapsed().as_secs() / 60 > told {
            told = start.elapsed().as_secs() / 60;
            eprintln!("soak: {told} min: {life}");
        }
    }
    let (tally, verdict) = life.end()?;
    let minutes = start.elapsed().as_secs_f64() / 60.0;
    println!("{minutes:.1} min\n{tally}");
    for memory in &memory {
        println!("{memory}");
    }
    check(&tally, &verdict, &memory)
}

/// Options of the mock: its faults, one after another.
fn faults(length: Duration) -> Vec<String> {
    let count = (length.as_secs_f64() / FAULT_EVERY.as_secs_f64()) as usize;
    let options = (1..=count).map(|k| {
        let (kind, at) = (FAULTS[k % FAULTS.len()], FAULT_EVERY.as_secs() * k as u64);
        format!("--fault={}@{at}s+{}ms", kind.name(), FAULT_LASTS.as_millis())
    });
    options.collect()
}

fn check(tally: &tally::Tally, verdict: &Value, memory: &[Memory]) -> anyhow::Result<()> {
    let violations = verdict["violations"].as_u64().context("no count of violations")?;
    let stopped = verdict["endpoint"]["timeouts"].as_u64().unwrap_or(0);
    println!("judge: {violations} violations; the endpoint stopped by itself {stopped} times");
    for violation in verdict["verdict"]["first"].as_array().into_iter().flatten() {
        eprintln!("soak: violation: {violation}");
    }
    ensure!(violations == 0, "the endpoint saw {violations} violations");
    tally.check()?;
    for memory in memory {
        memory.check(GROWTH)?;
    }
    Ok(())
}
