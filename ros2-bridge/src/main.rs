//! `ros2-bridge`: the hardware endpoint of Nullsweep for arms that speak ROS 2. Setpoints of the
//! executor become short trajectories for a ros2_control controller, its joint states become the
//! executor's states. And the other way round: a controller for ROS programs, with the executor
//! behind it.

mod args;
mod brake;
mod domain;
mod door;
mod endpoint;
mod follower;
mod goals;
mod link;
mod manager;
mod messages;
mod pictures;
mod scan;
mod serve;
mod show;
mod signals;
mod threads;
mod ticks;
mod told;
mod trajectory;
mod whole;
mod wish;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use nullsweep_executor::log::{Log, last_words};

use args::{Common, RunArgs, ScanArgs, ServeArgs, ShowArgs};

/// Stands between the executor and an arm that speaks ROS 2.
#[derive(Debug, Parser)]
#[command(
    name = "ros2-bridge",
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
    /// Be a controller for ROS programs, with the executor behind it, until ended
    Serve(Box<ServeArgs>),
    /// Show the arm and a plan to RViz and Foxglove, until ended
    Show(Box<ShowArgs>),
    /// Write one cloud of a topic as a scan for the planner
    Scan(Box<ScanArgs>),
}

fn main() -> ExitCode {
    // The priority in a cell is the executor's.
    let cli: Cli = match nullsweep_cell::parse(
        std::env::args_os(),
        &[("run", &["priority"]), ("serve", &["priority"]), ("show", &["priority"])],
        &[],
    ) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    // The executor's: no setpoint waits for whoever reads it.
    let log =
        Log::install("ros2_bridge=info,nullsweep_bridge=info,rustdds=off,ros2_client=off,warn");
    let result = match &cli.command {
        Command::Run(args) => endpoint::run(&cli.common, args),
        Command::Serve(args) => serve::run(&cli.common, args),
        Command::Show(args) => show::run(&cli.common, args),
        Command::Scan(args) => scan::run(&cli.common, args),
    };
    log.end();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            last_words(&format!("ros2-bridge: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
