//! How one program plays every part: with a hidden first argument it becomes the planner, the
//! executor or the mock, each with that program's own command line.

use std::ffi::OsString;
use std::process::ExitCode;

use crate::stage::{Part, die_with_parent};
use crate::{mock, publisher};

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
    })
}
