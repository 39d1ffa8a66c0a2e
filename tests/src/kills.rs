//! `kills`: a laboratory run that kills planner, executor and mock at random moments and looks
//! whether the arm always ends held or stopped by the rule, and everything starts again without
//! cleaning by hand.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use clap::Parser;
use nullsweep_ipc_types::{CommandKind, EventKind, Mode, PlanId, Reason};
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::parts;
use crate::stage::{Part, Process, Stage};
use crate::system::{PATIENT, PATIENT_MOCK, System, start_executor, start_mock};
use crate::witness::PATIENCE;

/// How often a motion may be broken off by a stall of the machine before it counts as a failure.
const TRIES: usize = 5;
/// Longest time from the start of a motion to the kill. \[ms\]
const LONGEST_MS: u64 = 1500;

/// Kills planner, executor and mock at random moments and looks what becomes of the arm.
#[derive(Debug, Parser)]
#[command(name = "kills", version)]
struct Args {
    /// How often each of the three is killed
    #[arg(long, default_value_t = 200)]
    each: usize,
    /// Seed of order and moments
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Copy the processes' output to this folder
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Victim {
    Planner,
    Executor,
    Mock,
}

/// The running system.
struct Lab<'a> {
    stage: &'a Stage,
    system: System,
    /// Counts starts, to tell output files apart.
    starts: usize,
    violations: u64,
    timeouts: u64,
    /// Motions that a stall of the machine ended, each by the executor's rule.
    stalls: u64,
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
            eprintln!("kills: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> anyhow::Result<()> {
    Stage::with(args.keep.as_deref(), |stage| kill_all(args, stage))
}

fn kill_all(args: &Args, stage: &Stage) -> anyhow::Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(args.seed);
    let mut left: BTreeMap<Victim, usize> =
        [Victim::Planner, Victim::Executor, Victim::Mock].map(|v| (v, args.each)).into();
    let mut lab = Lab::start(stage)?;
    let mut done = 0;
    while !left.is_empty() {
        let victims: Vec<_> = left.keys().copied().collect();
        let victim = *victims.choose(&mut random).context("somebody is left")?;
        let delay = Duration::from_millis(random.random_range(0..LONGEST_MS));
        lab.kill(victim, delay).with_context(|| {
            format!("kill {done} ({victim:?} after {delay:?}): {}", lab.system.witness)
        })?;
        done += 1;
        if let Some(count) = left.get_mut(&victim) {
            *count -= 1;
            if *count == 0 {
                left.remove(&victim);
            }
        }
        if done % 10 == 0 {
            eprintln!("kills: {done} of {}", 3 * args.each);
        }
    }
    lab.count_verdict()?;
    println!(
        "{done} kills ({} of each): every plan had its one end, the arm held or stopped by the \
         rule, all restarts went by themselves; {} violations at the endpoint, which stopped by \
         itself {} times; {} motions were stopped by the executor's rule as the machine stalled",
        args.each, lab.violations, lab.timeouts, lab.stalls
    );
    ensure!(lab.violations == 0, "the endpoint saw {} violations", lab.violations);
    Ok(())
}

impl<'a> Lab<'a> {
    fn start(stage: &'a Stage) -> anyhow::Result<Self> {
        let system = System::start(stage, PATIENT_MOCK, PATIENT)?;
        Ok(Self { stage, system, starts: 1, violations: 0, timeouts: 0, stalls: 0 })
    }

    /// One motion from where the arm is, one kill in it, and everything whole again.
    fn kill(&mut self, victim: Victim, delay: Duration) -> anyhow::Result<()> {
        self.home()?;
        let mut planner = self.publish(&["--stay", "--swings", "2", "--speed", "0.2"])?;
        let plan = self.running()?;
        thread::sleep(delay);
        match victim {
            Victim::Planner => {
                planner.kill()?;
                let end = self.system.witness.end(plan)?;
                if end.kind != EventKind::Finished.wire() {
                    // The executor keeps its rules also on a machine that stalls.
                    ensure!(end.reason == Reason::Fault.wire(), "the plan did not run to its end");
                    self.stalls += 1;
                }
                self.reset()?;
            }
            Victim::Executor => {
                self.system.executor.kill()?;
                self.starts += 1;
                let name = format!("executor-{}", self.starts);
                self.system.executor = start_executor(self.stage, &name, PATIENT)?;
                let held = self.system.witness.mode(Mode::Hold)?;
                ensure!(held.plan == PlanId::NONE, "a plan of before the restart was started");
            }
            Victim::Mock => {
                self.system.endpoint.kill()?;
                // The plan may have been over by then; else the loss of the arm ends it.
                self.system.witness.end(plan)?;
                let lost = self.system.witness.mode(Mode::Fault)?;
                // The arm is where it was last measured.
                let at: Vec<_> =
                    lost.measured[..lost.joint_count as usize].iter().map(f64::to_string).collect();
                self.starts += 1;
                let initial = format!("--initial={}", at.join(","));
                let name = format!("mock-{}", self.starts);
                let options = PATIENT_MOCK.map(String::from).into_iter().chain([initial]);
                self.system.endpoint = start_mock(self.stage, &name, options)?;
                self.reset()?;
            }
        }
        Ok(())
    }

    /// Brings the arm back to its home.
    fn home(&mut self) -> anyhow::Result<()> {
        for _ in 0..TRIES {
            let mut planner = self.publish(&["--home"])?;
            match planner.wait(PATIENCE)? {
                Some(status) if status.success() => return Ok(()),
                Some(_) if planner.stdout().contains(EventKind::Aborted.text()) => {
                    self.stalls += 1;
                    self.reset()?;
                }
                status => {
                    bail!("going home: {status:?}: {}{}", planner.stdout(), planner.stderr())
                }
            }
        }
        bail!("the return home was broken off {TRIES} times")
    }

    /// Waits until the arm is held, and resets a latched fault until its cause is gone.
    fn reset(&mut self) -> anyhow::Result<()> {
        for _ in 0..200 {
            let telemetry = self.system.witness.see("telemetry", |_| true)?;
            if telemetry.mode == Mode::Hold.wire() {
                return Ok(());
            }
            if telemetry.mode == Mode::Fault.wire() {
                self.system.witness.command(CommandKind::Reset, 0.0)?;
            }
            thread::sleep(Duration::from_millis(20));
        }
        bail!("the arm does not come to hold")
    }

    fn running(&mut self) -> anyhow::Result<PlanId> {
        Ok(self.system.witness.see("a plan in motion", |t| t.plan.is_some())?.plan)
    }

    fn publish(&mut self, options: &[&str]) -> anyhow::Result<Process> {
        let mut args = self.stage.place().to_vec();
        args.extend(options.iter().map(OsString::from));
        Ok(self.stage.start(Part::Sketch, "sketch", args)?)
    }

    /// Ends the mock and adds up what it found.
    fn count_verdict(&mut self) -> anyhow::Result<()> {
        let found: Value = self.system.end(self.stage)?;
        self.violations += found["violations"].as_u64().context("no count of violations")?;
        self.timeouts += found["endpoint"]["timeouts"].as_u64().unwrap_or(0);
        for violation in found["verdict"]["first"].as_array().into_iter().flatten() {
            eprintln!("kills: violation: {violation}");
        }
        Ok(())
    }
}
