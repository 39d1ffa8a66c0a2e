//! Completions and manual pages of all programs, made of what each tells of itself.

use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, ensure};
use clap::CommandFactory;
use clap_complete::Shell;
use nullsweep_cell::{DESCRIBE, Described, FRONT, VARIABLE, beside};

use crate::arguments::Cli;
use crate::out::write_out;
use crate::programs::{EXECUTOR, NAME, PLANNER, RELAY, whole};

/// Writes what a shell completes by to standard output.
///
/// # Errors
/// Where a program tells nothing of itself.
pub(crate) fn completions(shell: Shell) -> anyhow::Result<ExitCode> {
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut all()?, NAME, &mut text);
    write_out(&text)
}

/// Writes manual pages to a folder.
///
/// # Errors
/// Where a program tells nothing of itself, or the folder cannot be written.
pub(crate) fn manuals(folder: &Path) -> anyhow::Result<ExitCode> {
    let there = || format!("cannot write {}", folder.display());
    std::fs::create_dir_all(folder).with_context(there)?;
    clap_mangen::generate_to(all()?, folder).with_context(there)?;
    Ok(ExitCode::SUCCESS)
}

/// This program with all that the others take.
fn all() -> anyhow::Result<clap::Command> {
    let mut command = Cli::command();
    for program in [PLANNER, EXECUTOR] {
        for below in ask(program)?.below() {
            let name = below.name().to_owned();
            command = put(command, name, below);
        }
    }
    for (program, name) in whole() {
        command = put(command, name.to_owned(), ask(program)?);
    }
    if let Ok(relay) = ask(RELAY) {
        command = put(command, RELAY.to_owned(), relay);
    }
    Ok(command)
}

/// The command with a described one in place of what only gives arguments on.
fn put(command: clap::Command, name: String, described: Described) -> clap::Command {
    if command.find_subcommand(&name).is_none() {
        return command;
    }
    command.mut_subcommand(name.clone(), move |own| {
        let about = own.get_about().cloned();
        let described = described.into_command(name);
        if let Some(about) = about { described.about(about) } else { described }
    })
}

fn ask(program: &str) -> anyhow::Result<Described> {
    let path = beside(program);
    let told = Command::new(&path)
        .arg(DESCRIBE)
        .env(VARIABLE, "")
        .env(FRONT, NAME)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {}", path.display()))?;
    ensure!(told.status.success(), "{} does not tell what it takes", path.display());
    let text = String::from_utf8_lossy(&told.stdout);
    Described::from_json(&text).with_context(|| format!("what {} tells", path.display()))
}
