//! `executor top`: a live screen of a running executor, in the terminal.
//!
//! It is a client like any other, in a process of its own: whatever it does, the loop does not wait
//! for it. It stays when the executor goes, and goes on when one comes.

mod board;
mod keys;
mod screen;
#[cfg(test)]
mod tests;
mod watch;

use std::io::{self, IsTerminal};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Args;
use nullsweep_ipc_types::CommandKind;
use nullsweep_robot::{Arm, ArmSpec};
use ratatui::crossterm::event::{self, Event, KeyEventKind};

use crate::system::SystemArgs;
use board::Board;
use keys::Deed;
use watch::Watch;

/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(100);

#[derive(Debug, Args)]
pub(crate) struct TopArgs {
    #[command(flatten)]
    system: SystemArgs,
    /// The robot whose joints are named; the embedded PR2 where not given.
    #[arg(long, value_name = "FILE")]
    pub(crate) urdf: Option<PathBuf>,
    /// The arm: `right` or `left` of the PR2, else its base and tip link, BASE,TIP.
    #[arg(long, value_name = "ARM", default_value = "right")]
    pub(crate) arm: ArmSpec,
}

/// Shows the executor's state until `q`.
pub(crate) fn top(args: &TopArgs, arm: &Arm) -> io::Result<ExitCode> {
    if !io::stdout().is_terminal() || !io::stdin().is_terminal() {
        return Err(io::Error::other(
            "top draws on a terminal and reads its keys, and here is none: `executor ctl status` tells \
             mode and plan once",
        ));
    }
    let mut board = Board::new(&args.system.robot_name, arm);
    let mut watch = Watch::new(&args.system);
    let mut terminal = ratatui::try_init()?;
    let shown = loop {
        let now = Instant::now();
        watch.look(&mut board, now);
        if let Err(error) = terminal.draw(|frame| screen::draw(frame, &board, now)) {
            break Err(error);
        }
        match deed(now + PICTURE) {
            Ok(Some(Deed::Quit)) => break Ok(ExitCode::SUCCESS),
            Ok(Some(Deed::Command(kind))) => {
                watch.command(kind, 0.0, &mut board);
            }
            Ok(Some(Deed::Speed(by))) => {
                // What is in force says nothing while the arm rests: ask for what was asked for.
                if let Some(scale) = watch.command(CommandKind::Status, 0.0, &mut board) {
                    watch.command(CommandKind::Speed, keys::faster(scale, by), &mut board);
                }
            }
            Ok(None) => {}
            Err(error) => break Err(error),
        }
    };
    ratatui::try_restore()?;
    shown
}

/// What a key asks for, until a moment.
fn deed(until: Instant) -> io::Result<Option<Deed>> {
    loop {
        let left = until.saturating_duration_since(Instant::now());
        if !event::poll(left)? {
            return Ok(None);
        }
        if let Event::Key(key) = event::read()?
            && key.kind == KeyEventKind::Press
            && let Some(deed) = keys::deed(key)
        {
            return Ok(Some(deed));
        }
    }
}
