//! The command line of `planner`.

mod advice;
mod again;
mod bars;
mod bounds;
pub mod calls;
mod cell;
mod choices;
mod exit;
mod experiment;
mod export;
mod figures;
mod floor;
mod follow;
mod given;
mod goto;
mod gtsp;
mod inspect;
mod jerk;
mod jobs;
mod json;
mod line;
mod numbers;
mod obstacles;
mod output;
mod picture;
mod placed;
mod plan;
mod plan_command;
mod posture;
mod posture_arg;
mod program;
mod program_args;
mod program_error;
mod program_report;
mod publish;
mod publish_program;
mod refusal;
mod replan;
mod robot;
mod room;
mod scene;
mod scene_command;
mod scene_file;
mod send;
mod sheet;
mod site;
mod stop_run;
mod stops;
mod table;
mod task;
mod verify;
mod view;
mod views;
mod way;

pub use choices::{CostArg, FormatArg, JoinArg, MethodArg, ProfileArg};
pub use exit::{FAILED, LOST, MORE_JOBS, OK, USAGE, VIOLATIONS};

use std::ffi::OsString;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::{Parser, Subcommand};
use signal_hook::consts::SIGPIPE;

use output::complain;

/// Plans how a redundant arm sweeps a scanned surface, and publishes the plan.
#[derive(Debug, Parser)]
#[command(
    name = "planner",
    version,
    after_help = "Exit codes: 0 done; 1 failed; 2 wrong usage; 3 the plan breaks a rule; 4 the executor was lost while it was waited for; 5 jobs are to be done before `join` can go on."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a plan from scans, or from a simulated scan.
    Plan(Box<plan_command::PlanCommandArgs>),
    /// Put the plans of jobs together to a program, or write the next jobs.
    Join(jobs::JoinArgs),
    /// Show what is in a scanned scene: its planes, and its objects by number.
    Scene(Box<scene_command::SceneCommandArgs>),
    /// Make a plan through given tool poses, in whatever order is shortest.
    Task(Box<task::TaskArgs>),
    /// Make a plan that follows given tool paths in their order.
    Follow(Box<follow::FollowArgs>),
    /// Check a plan file against the scene that it was made for.
    Verify(Box<verify::VerifyArgs>),
    /// Show plans, scans and scenes in a browser: the arm moving, what is swept and what is left.
    View(Box<view::ViewArgs>),
    /// Send a plan to the executor, or work through a program, stop after stop.
    Publish(Box<publish::PublishArgs>),
    /// Bring the arm from where it is to a posture, or to a plan's start.
    Goto(Box<goto::GotoArgs>),
    /// Replace the plan that runs by one for what it has not swept yet, without a stop.
    Replan(Box<replan::ReplanArgs>),
    /// Solve a generalized travelling-salesman file.
    Gtsp(gtsp::GtspArgs),
    /// Write a plan as a trajectory for other programs.
    Export(export::ExportArgs),
    /// The paper's tables I and II, our figures beside the published ones.
    Experiment(Box<experiment::ExperimentArgs>),
    /// Write or check a cell file, which says once which robot and scene are meant.
    Cell(Box<cell::CellArgs>),
    /// Say what a plan file holds.
    Inspect(inspect::InspectArgs),
}

/// What a plan takes from the plan that it replaces.
const PLACED: [&str; 3] = ["start", "base", "held"];

/// Runs the command line and returns the process's exit code.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    // Whoever reads the output has read enough: no words about it.
    let _ = signal_hook::flag::register_conditional_shutdown(
        SIGPIPE,
        exit::BROKEN_PIPE,
        Arc::new(AtomicBool::new(true)),
    );
    let cli: Cli = match nullsweep_cell::parse(
        args,
        &[("replan", &PLACED), ("init", &nullsweep_cell::FLAGS)],
        &[],
    ) {
        Ok(cli) => cli,
        Err(e) => {
            let _ = e.print();
            return ExitCode::from(if e.use_stderr() { USAGE } else { OK });
        }
    };
    let result = match cli.command {
        Command::Plan(args) => plan_command::run(&args),
        Command::Join(args) => jobs::join(&args),
        Command::Scene(args) => scene_command::run(&args),
        Command::Task(args) => task::run(&args),
        Command::Follow(args) => follow::run(&args),
        Command::Verify(args) => verify::run(&args),
        Command::View(args) => view::run(&args),
        Command::Publish(args) => publish::run(&args),
        Command::Goto(args) => goto::run(&args),
        Command::Replan(args) => replan::run(&args),
        Command::Gtsp(args) => gtsp::run(&args, &mut std::io::stdout().lock())
            .map(|()| OK)
            .map_err(anyhow::Error::from),
        Command::Export(args) => export::run(&args),
        Command::Experiment(args) => experiment::run(&args),
        Command::Cell(args) => cell::run(&args),
        Command::Inspect(args) => inspect::run(&args),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(e) => {
            complain!("planner: {}", nullsweep_cell::causes(e.as_ref()));
            if let Some(advice) = advice::advice(&e) {
                complain!("help: {advice}");
            }
            ExitCode::from(exit::of(&e))
        }
    }
}
