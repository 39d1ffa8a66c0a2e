//! The latency lab: how late the executor wakes, how long its setpoints take to the endpoint and
//! a new plan to its first setpoint, beside what the machine does without it, in the same run.

mod args;
mod baseline;
mod cyclictest;
mod figures;
mod load;
mod picture;
mod station;
mod stats;

use std::ffi::OsString;
use std::fs;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, bail};
use nullsweep_executor::rt;
use nullsweep_ipc_types::ports::{Ipc, now_ns};
use nullsweep_ipc_types::{CommandKind, EventKind, HISTOGRAM_BUCKETS, Mode, PlanEvent};
use nullsweep_robot::{Arm, ArmSpec, JointVector, MAX_DOF, Robot, Side};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::clock::sleep_until;
use crate::parts;
use crate::sketch::Sketch;
use crate::stage::{Process, Stage};
use crate::system::start_executor;
use crate::witness::{PATIENCE, Witness};
use args::Args;
use figures::Sums;
use load::Load;

pub use figures::{Armed, Figures, Row, Swaps, Target};
pub use stats::{Percentiles, Times, of_buckets};

/// Length of the plans that are published. \[s\]
const PLAN_SECONDS: f64 = 0.04;
/// How far their joints go. \[rad\]
const PLAN_ANGLE: f64 = 0.005;
/// How the bare loop waits: as the executor does by default. \[ns\]
const SPIN_NS: u64 = 100_000;
/// Highest SCHED_FIFO priority of the thread that publishes and commands.
const PUBLISHER: u8 = 5;
/// Time between two plans: a rest that lets the last one end, and a random part that spreads the
/// moment over the executor's cycle. \[ns\]
const REST_NS: u64 = 180_000_000;
const SPREAD_NS: u64 = 40_000_000;

/// Runs the lab with the arguments of a command line, program name first.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args: Args = match parts::begin(args) {
        Ok(args) => args,
        Err(code) => return code,
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
    if let Some(cpu) = args.cpu {
        rt::probe_cpu(cpu).map_err(|why| anyhow::anyhow!("--cpu {cpu}: {why}"))?;
    }
    let arm = Robot::pr2().arm(&ArmSpec::pr2(Side::Right))?;
    let load = args.load.then(Load::start).transpose()?;
    if load.is_some() {
        // So that it is there in the first round as in the last.
        thread::sleep(Duration::from_secs(2));
    }
    let before = figures::loadavg();
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
        let root = stage.root();
        let bare = baseline::bare(&root, third, args.priority, args.cpu, SPIN_NS)?;
        sums.bare_compute.merge(&bare.compute);
        sums.bare_one_way.merge(&bare.one_way);
        eprintln!("latency: round {round} of {}: executor", args.rounds);
        let part = Part { args, arm: &arm, stage: &stage, time: share };
        measure(&part, &mut random, &mut sums)?;
    }
    drop(load);
    let figures = sums.figures(args, before);
    if let Some(path) = &args.report {
        fs::write(path, sums.page(&figures))
            .with_context(|| format!("cannot write the picture to {}", path.display()))?;
    }
    figures.tell(args.json.as_deref())?;
    Ok(figures)
}

/// The executor's part of one round: what is asked for, and how long it takes.
#[derive(Clone, Copy)]
struct Part<'a> {
    args: &'a Args,
    arm: &'a Arm,
    stage: &'a Stage,
    time: Duration,
}

/// One round with an executor, an endpoint in this process, and plans at random moments.
fn measure(part: &Part<'_>, random: &mut ChaCha8Rng, sums: &mut Sums) -> anyhow::Result<()> {
    let Part { args, arm, stage, .. } = *part;
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
        // In a thread of its own, as children inherit what it is given.
        let published = thread::scope(|scope| {
            let publishing = scope.spawn(|| {
                // How long an ordinary thread waits for a processor is not the executor's affair.
                rt::raise(args.priority.min(PUBLISHER));
                publish(part, &mut executor, random, sums)
            });
            publishing.join()
        });
        done.store(true, Ordering::Relaxed);
        let seen = endpoint.join().map_err(|_| anyhow::anyhow!("the endpoint's thread died"))??;
        let published = published
            .map_err(|_| anyhow::anyhow!("the publishing thread died"))?
            .with_context(|| format!("executor: {}", executor.stderr().trim_end()))?;
        executor.terminate(PATIENCE)?;
        sums.armed.add(&executor.stderr());
        sums.transport.merge(&seen.transport);
        sums.inter_arrival.merge(&seen.inter_arrival);
        sums.made_late.merge(&seen.made_late);
        sums.violations += seen.verdict.total();
        for violation in &seen.verdict.first {
            eprintln!("latency: violation: {violation}");
        }
        for event in published {
            let epoch = event.plan.epoch;
            let admitted = (event.value * 1e9) as u64;
            sums.admission.record(admitted);
            if let Some((_, first_ns)) = seen.first.iter().find(|(id, _)| *id == event.plan) {
                sums.swap.record(first_ns - epoch);
                sums.after_admission.record((first_ns - epoch).saturating_sub(admitted));
            }
        }
        sums.swaps.add(&seen.verdict);
        Ok(())
    })
}

/// The priority of what must not delay the executor.
fn below(priority: u8) -> u8 {
    priority.saturating_sub(1)
}

/// Publishes plans at moments that are drawn in advance, whatever became of the last one, and asks
/// for the status while the executor is busy with each; the acceptances.
fn publish(
    part: &Part<'_>,
    executor: &mut Process,
    random: &mut ChaCha8Rng,
    sums: &mut Sums,
) -> anyhow::Result<Vec<PlanEvent>> {
    let Part { args, arm, stage, time } = *part;
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
        let plan = publisher.publish(&sketch.header, &sketch.knots)?;
        sums.publication.record(now_ns() - plan.epoch);
        plans.push(plan);
        let asked_ns = now_ns();
        witness.command(CommandKind::Status, 0.0)?;
        sums.command.record(now_ns() - asked_ns);
    }
    if let Some(status) = executor.status()? {
        bail!("the executor ended by itself: {status}");
    }
    for plan in &plans {
        witness.admission(*plan)?;
    }
    let accepted: Vec<_> = witness
        .events()
        .iter()
        .filter(|e| e.kind == EventKind::Accepted.wire() && plans.contains(&e.plan))
        .copied()
        .collect();
    sums.published += plans.len();
    sums.accepted += accepted.len();
    let telemetry = witness.see("a last snapshot", |_| true)?;
    for bucket in 0..HISTOGRAM_BUCKETS {
        sums.wake[bucket] += telemetry.lateness[bucket];
        sums.compute[bucket] += telemetry.compute[bucket];
        sums.round_trip[bucket] += telemetry.round_trip[bucket];
    }
    sums.missed += telemetry.missed_cycles;
    Ok(accepted)
}
