//! `nullsweep`: one program that starts the others, as cargo does. It does nothing of what they do: each
//! runs as a process of its own, in this one's place.

mod describe;
mod doctor;
mod programs;

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use clap_complete::Shell;

use programs::{EXECUTOR, PLANNER, start, start_endpoint};

/// Sweeps scanned surfaces with a robot arm: plans, executes, and all around it.
#[derive(Debug, Parser)]
#[command(
    name = "nullsweep",
    version,
    disable_help_subcommand = true,
    after_help = "`nullsweep COMMAND --help` tells more of each. They are programs of their own: planner, \
                  executor, mock-hardware and the rest."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// What is given on to the other program as it stands.
#[derive(Debug, Args)]
struct Rest {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    args: Vec<OsString>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a plan from scans, or from a simulated scan.
    #[command(disable_help_flag = true)]
    Plan(Rest),
    /// Make a plan through given tool poses.
    #[command(disable_help_flag = true)]
    Task(Rest),
    /// Show what is in a scanned scene.
    #[command(disable_help_flag = true)]
    Scene(Rest),
    /// Check a plan file against its scene.
    #[command(disable_help_flag = true)]
    Verify(Rest),
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
    /// Start the endpoint that the cell file names.
    #[command(disable_help_flag = true)]
    Endpoint(Rest),
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

fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Doctor => doctor::run(),
        Command::Completions { shell } => describe::completions(shell),
        Command::Man { folder } => describe::manuals(&folder),
        Command::Plan(rest) => start(PLANNER, Some("plan"), rest.args),
        Command::Task(rest) => start(PLANNER, Some("task"), rest.args),
        Command::Scene(rest) => start(PLANNER, Some("scene"), rest.args),
        Command::Verify(rest) => start(PLANNER, Some("verify"), rest.args),
        Command::Inspect(rest) => start(PLANNER, Some("inspect"), rest.args),
        Command::Export(rest) => start(PLANNER, Some("export"), rest.args),
        Command::Cell(rest) => start(PLANNER, Some("cell"), rest.args),
        Command::Goto(rest) => start(PLANNER, Some("goto"), rest.args),
        Command::Publish(rest) => start(PLANNER, Some("publish"), rest.args),
        Command::Replan(rest) => start(PLANNER, Some("replan"), rest.args),
        Command::Gtsp(rest) => start(PLANNER, Some("gtsp"), rest.args),
        Command::Experiment(rest) => start(PLANNER, Some("experiment"), rest.args),
        Command::Run(rest) => start(EXECUTOR, Some("run"), rest.args),
        Command::Ctl(rest) => start(EXECUTOR, Some("ctl"), rest.args),
        Command::Top(rest) => start(EXECUTOR, Some("top"), rest.args),
        Command::Replay(rest) => start(EXECUTOR, Some("replay"), rest.args),
        Command::Endpoint(rest) => start_endpoint(rest.args),
        Command::Mock(rest) => start("mock-hardware", None, rest.args),
        Command::Demo(rest) => start("demo", None, rest.args),
        Command::Conformance(rest) => start("conformance", None, rest.args),
        Command::Latency(rest) => start("latency", None, rest.args),
        Command::Kills(rest) => start("kills", None, rest.args),
        Command::Soak(rest) => start("soak", None, rest.args),
    };
    match result {
        Ok(code) => code,
        Err(e) => {
            eprintln!("nullsweep: {e:#}");
            ExitCode::FAILURE
        }
    }
}

/// Writes to standard output; whoever has read enough has.
fn write_out(text: &[u8]) -> anyhow::Result<ExitCode> {
    use std::io::Write;
    match std::io::stdout().lock().write_all(text) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(e.into()),
        _ => Ok(ExitCode::SUCCESS),
    }
}
