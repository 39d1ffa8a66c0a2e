//! `relay`: carries plans, events, telemetry and commands between two iceoryx2 worlds, over zenoh. Not
//! setpoints: the executor stays beside its endpoint, and goes on as it was told whatever becomes of
//! the link.

mod args;
mod ask;
mod clock;
mod keys;
mod ledger;
mod link;
mod net;
mod planner;
mod robot;
mod schema;
mod sent;
mod wire;
mod world;

use std::io::IsTerminal;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use tracing_subscriber::EnvFilter;

use args::{Action, Cli};

/// What is logged, unless RUST_LOG says otherwise. zenoh's routing warns that nobody is looked for, which is
/// meant.
const LOG: &str = "relay=info,zenoh::net::routing=error,warn";

fn main() -> ExitCode {
    let cli: Cli = match nullsweep_cell::parse(std::env::args_os(), &[], &[]) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| LOG.into());
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .init();
    match run(&cli.command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("relay: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(action: &Action) -> anyhow::Result<ExitCode> {
    let flag = Arc::new(AtomicBool::new(false));
    if !matches!(action, Action::Ask(_)) {
        for signal in [SIGINT, SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&flag))?;
        }
    }
    let done = || flag.load(Ordering::Relaxed);
    match action {
        Action::Robot(args) => robot::run(args, &done)?,
        Action::Planner(args) => planner::run(args, &done)?,
        Action::Ask(args) => return ask::run(args),
    }
    Ok(ExitCode::SUCCESS)
}
