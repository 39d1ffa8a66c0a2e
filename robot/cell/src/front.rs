//! How a program is called by whoever reads what it says.

use std::path::{Path, PathBuf};

/// Names the program that started this one in its own place, as `nullsweep plan` starts `planner`: what
/// is said then speaks of that one.
pub const FRONT: &str = "NULLSWEEP_FRONT";

/// Each program of the house, and what it is as a command of the front: empty where its commands are
/// commands of the front's.
pub const PROGRAMS: [(&str, &str); 8] = [
    ("planner", ""),
    ("executor", ""),
    ("mock-hardware", "mock"),
    ("demo", "demo"),
    ("conformance", "conformance"),
    ("latency", "latency"),
    ("kills", "kills"),
    ("soak", "soak"),
];

/// A program beside the one that runs; else its name, to be found on the PATH.
#[must_use]
pub fn beside(program: &str) -> PathBuf {
    let own = std::env::current_exe().ok();
    let beside = own.and_then(|own| Some(own.parent()?.join(program)));
    beside.filter(|path| path.is_file()).unwrap_or_else(|| program.into())
}

/// The program that a cell file in `folder` names: a path is from that folder on, a name is looked for as
/// [`beside`] does.
#[must_use]
pub fn named_in(folder: &Path, program: &str) -> PathBuf {
    if program.contains('/') { folder.join(program) } else { beside(program) }
}

/// Whether there is such a program: a file, or a name that is found on the PATH.
#[must_use]
pub fn is_program(program: &Path) -> bool {
    if program.components().count() > 1 {
        return program.is_file();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(program).is_file())
}

/// A text with the front's name in place of those of the programs behind it, where a front has started
/// this one: in commands (between backticks), and before a colon at the beginning.
#[must_use]
pub fn as_called(text: impl Into<String>) -> String {
    match std::env::var(FRONT) {
        Ok(front) if !front.is_empty() => called(text.into(), &front),
        _ => text.into(),
    }
}

fn called(mut text: String, front: &str) -> String {
    for (program, command) in PROGRAMS {
        let gap = if command.is_empty() { "" } else { " " };
        text = text.replace(&format!("`{program} "), &format!("`{front}{gap}{command} "));
        if let Some(rest) = text.strip_prefix(program).filter(|rest| rest.starts_with(": ")) {
            text = format!("{front}{gap}{command}{rest}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_speaks_of_the_front() {
        let said = |text: &str| called(text.into(), "nullsweep");
        assert_eq!(said("see `executor ctl status`, `planner goto A`"), {
            "see `nullsweep ctl status`, `nullsweep goto A`"
        });
        assert_eq!(said("`mock-hardware --wrap`"), "`nullsweep mock --wrap`");
        assert_eq!(said("planner: no file"), "nullsweep: no file");
        assert_eq!(said("the planner: an executor"), "the planner: an executor");
    }
}
