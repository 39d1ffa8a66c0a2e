//! `nullsweep`: one program that starts the others, as cargo does. It does nothing of what they do: each
//! runs as a process of its own, in this one's place.

mod arguments;
mod describe;
mod doctor;
mod out;
mod programs;

use std::ffi::OsString;
use std::process::ExitCode;

use arguments::{Cli, Command};
use programs::{EXECUTOR, PLANNER, RELAY, start, start_endpoint};

/// Does what a command line says, program name first. Where another program is started, this does not
/// return.
pub fn main(args: impl IntoIterator<Item = OsString>) -> ExitCode {
    let cli: Cli = nullsweep_cell::parse_alone(args).unwrap_or_else(|e| e.exit());
    let cell = cli.cell.as_deref();
    let start = |program, command, args| start(cell, program, command, args);
    let result = match cli.command {
        Command::Doctor | Command::Completions { .. } | Command::Man { .. } if cell.is_some() => {
            Err(anyhow::anyhow!("--cell is for commands that have to do with a robot"))
        }
        Command::Doctor => doctor::run(),
        Command::Completions { shell } => describe::completions(shell),
        Command::Man { folder } => describe::manuals(&folder),
        Command::Plan(rest) => start(PLANNER, Some("plan"), rest.args),
        Command::Join(rest) => start(PLANNER, Some("join"), rest.args),
        Command::Task(rest) => start(PLANNER, Some("task"), rest.args),
        Command::Follow(rest) => start(PLANNER, Some("follow"), rest.args),
        Command::Scene(rest) => start(PLANNER, Some("scene"), rest.args),
        Command::Verify(rest) => start(PLANNER, Some("verify"), rest.args),
        Command::View(rest) => start(PLANNER, Some("view"), rest.args),
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
        Command::Endpoint(rest) => start_endpoint(cell, rest.args),
        Command::Relay(rest) => start(RELAY, None, rest.args),
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
