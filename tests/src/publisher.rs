//! Publishes a sketch as a process of its own, so that a test can end it at any moment.

use std::ffi::OsString;
use std::process::ExitCode;
use std::thread;
use std::time::Duration;

use clap::Parser;
use nullsweep_ipc_types::ports::Ipc;
use nullsweep_ipc_types::{EventKind, Mode, Reason};
use nullsweep_robot::{JointVector, MAX_DOF};

use crate::arm_args::ArmArgs;
use crate::sketch::Sketch;
use crate::witness::Witness;

/// Nearer than this the arm is at home. \[rad\]
const AT_HOME: f64 = 1e-3;

/// Publishes swings of every joint from the arm's home and back.
#[derive(Debug, Parser)]
#[command(name = "sketch")]
struct Args {
    #[command(flatten)]
    arm: ArmArgs,
    /// How often to swing out and back
    #[arg(long, default_value_t = 1)]
    swings: usize,
    /// How far each joint swings, in rad
    #[arg(long, default_value_t = 0.2)]
    angle: f64,
    /// Share of the velocity limits
    #[arg(long, default_value_t = 0.3)]
    speed: f64,
    /// Instead of swinging, go home from where the arm is commanded
    #[arg(long)]
    home: bool,
    /// Stay alive after the plan was accepted, instead of waiting for its end
    #[arg(long)]
    stay: bool,
}

/// Runs with the arguments of a command line, program name first.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let args = match Args::try_parse_from(args) {
        Ok(args) => args,
        Err(error) => error.exit(),
    };
    match run(&args) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("sketch: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Whether the plan was executed to its end.
fn run(args: &Args) -> anyhow::Result<bool> {
    let arm = args.arm.load()?;
    let ipc = Ipc::open(&args.arm.robot_name, args.arm.ipc_root.as_deref())?;
    let mut witness = Witness::open(&ipc)?;
    let sketch = if args.home {
        let held = witness.mode(Mode::Hold)?;
        let mut from = JointVector::default();
        from.copy_from_slice(&held.commanded[..MAX_DOF]);
        if (0..arm.dof()).all(|j| (from[j] - arm.home()[j]).abs() < AT_HOME) {
            println!("at home");
            return Ok(true);
        }
        Sketch::through(&arm, &[from, arm.home()], args.speed)
    } else {
        Sketch::swings(&arm, &arm.home(), args.swings, args.angle, args.speed)
    };
    let mut publisher = ipc.plan_publisher(sketch.knots.len())?;
    let plan = publisher.publish(&sketch.header, &sketch.knots)?;
    println!("published {plan}");
    let answer = witness.admission(plan)?;
    if answer.kind == EventKind::Rejected.wire() {
        let reason = Reason::from_wire(answer.reason).map_or("unknown reason", Reason::text);
        println!("rejected: {reason}");
        return Ok(false);
    }
    println!("accepted");
    if args.stay {
        loop {
            thread::sleep(Duration::from_secs(1));
        }
    }
    let end = witness.end(plan)?;
    println!("{}", EventKind::from_wire(end.kind).map_or("unknown end", EventKind::text));
    Ok(end.kind == EventKind::Finished.wire())
}
