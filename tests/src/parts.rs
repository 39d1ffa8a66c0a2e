//! How one program plays every part: with a hidden first argument it becomes the planner, the
//! executor, the mock or the front, each with that program's own command line; else it is itself, by its own.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use crate::stage::{Part, die_with_parent};
use crate::{mock, publisher};

/// The arguments of a program that plays other parts too, program name first. A command line that is
/// wrong, or asks for help, ends the process.
///
/// # Errors
/// The exit code, where it has played another part.
pub fn begin<A: Parser>(args: impl IntoIterator<Item = OsString>) -> Result<A, ExitCode> {
    let args: Vec<_> = args.into_iter().collect();
    match play(&args) {
        Some(code) => Err(code),
        None => Ok(nullsweep_cell::parse_alone(args).unwrap_or_else(|error| error.exit())),
    }
}

/// Plays the part that the first argument names and gives its exit code; `None` where it names
/// no part and the program shall go on as itself.
#[must_use]
pub fn play(args: &[OsString]) -> Option<ExitCode> {
    let part = *Part::ALL.iter().find(|p| args.get(1).is_some_and(|a| a == p.argument()))?;
    if let Err(error) = die_with_parent() {
        eprintln!("{}: cannot be tied to its parent: {error}", part.name());
        return Some(ExitCode::from(2));
    }
    let own = std::iter::once(OsString::from(part.name())).chain(args[2..].iter().cloned());
    Some(match part {
        Part::Planner => nullsweep_cli::main(own),
        Part::Executor => nullsweep_executor::main_with(own),
        Part::Mock => mock::main(own),
        Part::Sketch => publisher::main(own),
        Part::Front => nullsweep::main(own),
    })
}
