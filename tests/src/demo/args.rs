//! The demo's command line.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use nullsweep_cli::ProfileArg;
use serde::Serialize;

use crate::endpoint::Fidelity;

/// The endpoint's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hardware {
    /// `mock-hardware`, which judges every setpoint.
    Mock,
    /// A PR2 arm in MuJoCo, `examples/mujoco/endpoint.py`.
    Mujoco,
}

/// Plans a chair's seat, sweeps it with a simulated PR2, and swaps in a second plan mid-motion.
#[derive(Debug, Parser)]
#[command(
    name = "demo",
    version,
    after_help = "Exit codes: 0 both plans passed their check, the swap took place, the endpoint \
                  saw nothing wrong, and what was measured covers what was planned, or, with --whole, \
                  the program was resumed both times and swept what it promised; 1 one of them \
                  is not so; 2 the demo failed; 77 what --hardware needs is not installed."
)]
pub(super) struct Args {
    /// Sweep a whole chair instead, from three places by both arms, and kill who works through the program
    /// and an executor on the way; with the mock's joints behind a stiff position loop
    #[arg(long, conflicts_with_all = ["hardware", "fidelity", "base", "torso"])]
    pub(super) whole: bool,
    /// What stands in for the robot
    #[arg(long, value_enum, default_value = "mock")]
    pub(super) hardware: Hardware,
    /// How fast the plans go along their paths
    #[arg(long, value_enum, default_value = "acceleration")]
    pub(super) profile: ProfileArg,
    /// With --hardware mujoco: the Python that has its packages
    #[arg(long, default_value = "python3", value_name = "PROGRAM")]
    pub(super) python: String,
    /// With --hardware mujoco: where the picture of the arm at the chair is written
    #[arg(long, default_value = "demo.nullsweep-mujoco.png", value_name = "FILE")]
    pub(super) picture: PathBuf,
    /// Where the report of the first plan is written
    #[arg(long, default_value = "demo.nullsweep-report.html", value_name = "FILE")]
    pub(super) report: PathBuf,
    /// Write every figure as JSON, to a file or to standard output with -
    #[arg(long, value_name = "FILE|-")]
    pub(super) json: Option<PathBuf>,
    /// Copy the plans and the processes' output to this folder
    #[arg(long, value_name = "DIR")]
    pub(super) keep: Option<PathBuf>,
    /// Where the robot stands: x,y,yaw before the chair, or auto, which searches for longer
    #[arg(
        long,
        default_value = "-0.708,-0.004,1.047",
        allow_hyphen_values = true,
        value_name = "X,Y,YAW"
    )]
    pub(super) base: String,
    /// Height of the torso, with a given base, in m
    #[arg(long, default_value_t = 0.2, value_name = "H")]
    pub(super) torso: f64,
    /// Velocity of the fastest joint, in rad/s: slow enough to be watched
    #[arg(long, default_value_t = 0.8, value_name = "V")]
    pub(super) v_max: f64,
    /// With --hardware mock: how true to a robot the arm is
    #[arg(long, value_enum, default_value = "mechanism")]
    pub(super) fidelity: Fidelity,
    /// Seed of both plans
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// Samples of the inverse kinematics at each tool pose
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(super) ik_samples: u32,
}
