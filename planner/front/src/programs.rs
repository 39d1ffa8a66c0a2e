//! The other programs, and how one is started in this one's place.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};
use nullsweep_cell::{Cell, FILE_NAME, FRONT, PROGRAMS, VARIABLE, beside, named_in};

pub(crate) const PLANNER: &str = "planner";
pub(crate) const EXECUTOR: &str = "executor";
/// A workspace of its own, so it may be missing.
pub(crate) const RELAY: &str = "relay";

/// What the others call this one.
pub(crate) const NAME: &str = "nullsweep";

/// The programs whose whole command line is one command of this one, and that command.
pub(crate) fn whole() -> impl Iterator<Item = (&'static str, &'static str)> {
    PROGRAMS.into_iter().filter(|(_, command)| !command.is_empty())
}

/// Becomes a program, which speaks of it as a command of this one. `cell` is the file that was named
/// before the command.
///
/// # Errors
/// Where it cannot be started; else this does not return.
pub(crate) fn start(
    cell: Option<&Path>,
    program: &str,
    command: Option<&str>,
    args: Vec<OsString>,
) -> anyhow::Result<ExitCode> {
    let shown = whole()
        .chain([(RELAY, RELAY)])
        .find(|(name, _)| *name == program)
        .map_or(NAME.into(), |(_, command)| format!("{NAME} {command}"));
    let path = beside(program);
    let mut started = Command::new(&path);
    started.arg0(shown).env(FRONT, NAME).args(named(cell)).args(command).args(args);
    let error = started.exec();
    Err(error).with_context(|| match program {
        RELAY => format!(
            "cannot start {}: it is no part of the default build; `cargo install --path relay` installs \
             it",
            path.display()
        ),
        _ => format!(
            "cannot start {}: `cargo install --path FOLDER` installs it, for each of the folders \
             planner/cli, executor, tests",
            path.display()
        ),
    })
}

/// What names a cell file on a command line.
fn named(cell: Option<&Path>) -> impl Iterator<Item = OsString> {
    cell.into_iter().flat_map(|file| ["--cell".into(), file.into()])
}

/// Becomes the endpoint that the cell file names, in the folder of that file, from which its paths are.
///
/// # Errors
/// No cell file, none in it, or it cannot be started.
pub(crate) fn start_endpoint(
    cell: Option<&Path>,
    mut args: Vec<OsString>,
) -> anyhow::Result<ExitCode> {
    args.extend(named(cell));
    let Some(file) = nullsweep_cell::take(&mut args) else {
        bail!("no {FILE_NAME} here or above: `nullsweep cell init` writes one");
    };
    let file = std::path::absolute(&file)?;
    let folder = file.parent().unwrap_or(Path::new("/"));
    let Some((program, own)) = Cell::read(&file)?.endpoint.and_then(|command| {
        let (program, own) = command.split_first()?;
        Some((program.clone(), own.to_vec()))
    }) else {
        bail!("{} names no endpoint: endpoint = [\"mock-hardware\"] would", file.display());
    };
    let program = named_in(folder, &program);
    let mut started = Command::new(&program);
    started.args(own).args(args).current_dir(folder).env(VARIABLE, &file).env(FRONT, NAME);
    let error = started.exec();
    let program = program.display();
    Err(error)
        .with_context(|| format!("cannot start {program}, the endpoint of {}", file.display()))
}
