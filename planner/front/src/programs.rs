//! The other programs, and how one is started in this one's place.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, bail};
use nullsweep_cell::{Cell, FILE_NAME, VARIABLE};

pub(crate) const PLANNER: &str = "planner";
pub(crate) const EXECUTOR: &str = "executor";

/// The programs whose whole command line is one command of this one, and that command.
pub(crate) const WHOLE: [(&str, &str); 6] = [
    ("mock-hardware", "mock"),
    ("demo", "demo"),
    ("conformance", "conformance"),
    ("latency", "latency"),
    ("kills", "kills"),
    ("soak", "soak"),
];

/// A program beside this one; else its name, to be found on the PATH.
pub(crate) fn path(program: &str) -> PathBuf {
    let beside = std::env::current_exe().ok().and_then(|own| Some(own.parent()?.join(program)));
    beside.filter(|path| path.is_file()).unwrap_or_else(|| program.into())
}

/// Becomes a program, whose help speaks of it as a command of this one.
///
/// # Errors
/// Where it cannot be started; else this does not return.
pub(crate) fn start(
    program: &str,
    command: Option<&str>,
    args: Vec<OsString>,
) -> anyhow::Result<ExitCode> {
    let whole = WHOLE.iter().find(|(name, _)| *name == program);
    let shown = whole.map_or("nullsweep".into(), |(_, command)| format!("nullsweep {command}"));
    let path = path(program);
    let error = Command::new(&path).arg0(shown).args(command).args(args).exec();
    Err(error).with_context(|| {
        format!(
            "cannot start {}: `cargo install --path FOLDER` installs it, for each of the folders \
             planner/cli, executor, tests",
            path.display()
        )
    })
}

/// Becomes the endpoint that the cell file names, in the folder of that file, from which its paths are.
///
/// # Errors
/// No cell file, none in it, or it cannot be started.
pub(crate) fn start_endpoint(mut args: Vec<OsString>) -> anyhow::Result<ExitCode> {
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
    // A name is looked for beside this program and on the PATH, a path is from the cell's folder on.
    let program = if program.contains('/') { folder.join(program) } else { path(&program) };
    let error =
        Command::new(&program).args(own).args(args).current_dir(folder).env(VARIABLE, &file).exec();
    let program = program.display();
    Err(error)
        .with_context(|| format!("cannot start {program}, the endpoint of {}", file.display()))
}
