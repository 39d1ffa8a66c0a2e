//! `pr2-bridge`: the hardware endpoint of Nullsweep for a PR2. Setpoints of the executor become
//! short trajectories for the arm's controller, its joint states become the executor's states.

mod args;
mod endpoint;
mod link;
mod trajectory;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use nullsweep_executor::log::{Log, last_words};

use args::{Common, RunArgs};

/// Stands between the executor and a PR2's ROS 1 master.
#[derive(Debug, Parser)]
#[command(
    name = "pr2-bridge",
    version,
    after_help = "Exit codes: 0 ended by SIGINT or SIGTERM; 1 failed; 2 wrong usage."
)]
struct Cli {
    #[command(flatten)]
    common: Common,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Be the endpoint until ended
    Run(Box<RunArgs>),
    /// Call the driver's reset_motors
    Reset,
    /// Call the driver's halt_motors
    Halt,
}

fn main() -> ExitCode {
    // The priority in a cell is the executor's.
    let cli: Cli = match nullsweep_cell::parse(
        std::env::args_os(),
        &[("run", &["priority"])],
        &["reset", "halt"],
    ) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    // The executor's: no setpoint waits for whoever reads it.
    let log = Log::install("pr2_bridge=info,nullsweep_bridge=info,warn");
    let result = match &cli.command {
        Command::Run(args) => endpoint::run(&cli.common, args),
        Command::Reset => link::call(&cli.common, link::Service::Reset),
        Command::Halt => link::call(&cli.common, link::Service::Halt),
    };
    log.end();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            last_words(&format!("pr2-bridge: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
