//! What `nullsweep` is asked for.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;

/// Sweeps scanned surfaces with a robot arm: plans, executes, and all around it.
#[derive(Debug, Parser)]
#[command(
    name = "nullsweep",
    version,
    disable_help_subcommand = true,
    after_help = "`nullsweep COMMAND --help` tells more of each. They are programs of their own: planner, \
                  executor, mock-hardware and the rest."
)]
pub(crate) struct Cli {
    /// Take what is not given from this file; as well behind the command.
    #[arg(long, value_name = "FILE")]
    pub(crate) cell: Option<PathBuf>,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What is given on to the other program as it stands.
#[derive(Debug, Args)]
pub(crate) struct Rest {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    pub(crate) args: Vec<OsString>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Make a plan from scans, or from a simulated scan.
    #[command(disable_help_flag = true)]
    Plan(Rest),
    /// Put the plans of jobs together to a program, or write the next jobs.
    #[command(disable_help_flag = true)]
    Join(Rest),
    /// Make a plan through given tool poses, in whatever order is shortest.
    #[command(disable_help_flag = true)]
    Task(Rest),
    /// Make a plan that follows given tool paths in their order.
    #[command(disable_help_flag = true)]
    Follow(Rest),
    /// Show what is in a scanned scene.
    #[command(disable_help_flag = true)]
    Scene(Rest),
    /// Check a plan file against its scene.
    #[command(disable_help_flag = true)]
    Verify(Rest),
    /// Show plans, scans, scenes and recordings on one page.
    #[command(disable_help_flag = true)]
    View(Rest),
    /// Say what a plan file holds.
    #[command(disable_help_flag = true)]
    Inspect(Rest),
    /// Write a plan as a trajectory for other programs.
    #[command(disable_help_flag = true)]
    Export(Rest),
    /// Write or check a cell file.
    #[command(disable_help_flag = true)]
    Cell(Rest),
    /// Bring the arm to a posture, or to a plan's start.
    #[command(disable_help_flag = true)]
    Goto(Rest),
    /// Send a plan to the executor.
    #[command(disable_help_flag = true)]
    Publish(Rest),
    /// Replace the plan that runs, without a stop.
    #[command(disable_help_flag = true)]
    Replan(Rest),
    /// Solve a generalized travelling-salesman file.
    #[command(disable_help_flag = true)]
    Gtsp(Rest),
    /// The paper's tables, ours beside them.
    #[command(disable_help_flag = true)]
    Experiment(Rest),
    /// The executor: the real-time loop.
    #[command(disable_help_flag = true)]
    Run(Rest),
    /// Pause, resume, stop, reset; speed and status.
    #[command(disable_help_flag = true)]
    Ctl(Rest),
    /// Watch the executor on a live screen.
    #[command(disable_help_flag = true)]
    Top(Rest),
    /// Run a flight recording again.
    #[command(disable_help_flag = true)]
    Replay(Rest),
    /// Start the endpoint that the cell file names, in the folder of that file.
    #[command(disable_help_flag = true)]
    Endpoint(Rest),
    /// Carry plans, events, telemetry and commands to another host: a program that is installed by itself.
    #[command(disable_help_flag = true)]
    Relay(Rest),
    /// A simulated arm that judges every setpoint.
    #[command(disable_help_flag = true)]
    Mock(Rest),
    /// Plan, execute and swap plans on a simulated robot.
    #[command(disable_help_flag = true)]
    Demo(Rest),
    /// Try a hardware endpoint, rule by rule.
    #[command(disable_help_flag = true)]
    Conformance(Rest),
    /// Measure how late the executor wakes, and what its messages take.
    #[command(disable_help_flag = true)]
    Latency(Rest),
    /// Kill planner, executor and mock at random moments.
    #[command(disable_help_flag = true)]
    Kills(Rest),
    /// Run the system for long with everything that can happen to it.
    #[command(disable_help_flag = true)]
    Soak(Rest),
    /// Tell what this machine lacks for real time, with the line that mends it.
    Doctor,
    /// Write what a shell completes commands by.
    Completions {
        /// Which shell.
        shell: Shell,
    },
    /// Write manual pages.
    Man {
        /// The folder that they are written to.
        folder: PathBuf,
    },
}
