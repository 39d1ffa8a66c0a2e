//! What a command writes: files, of which it is known before the work whether that goes, and words.

use std::fmt::Arguments;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::Path;

use anyhow::Context;

/// Whether a file can be written there, told before the work that it is to hold. What is there is left
/// as it is.
///
/// # Errors
/// Names the file.
pub(super) fn writable(path: &Path) -> anyhow::Result<()> {
    if path == Path::new("-") {
        return Ok(());
    }
    let is_new = !path.exists();
    let opened = OpenOptions::new().append(true).create(true).open(path);
    opened.with_context(|| format!("cannot write {}", path.display()))?;
    if is_new {
        std::fs::remove_file(path).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Writes to standard output.
///
/// # Errors
/// Where it takes no more, as a full disk does.
pub(super) fn write_out(words: Arguments<'_>) -> anyhow::Result<()> {
    let words = nullsweep_cell::as_called(words.to_string());
    std::io::stdout().lock().write_all(words.as_bytes()).context("cannot write to standard output")
}

/// Says a line on standard output; a command fails that cannot.
macro_rules! say {
    ($($words:tt)*) => {
        $crate::output::write_out(format_args!("{}\n", format_args!($($words)*)))?
    };
}

/// The same without the end of a line.
macro_rules! say_on {
    ($($words:tt)*) => {
        $crate::output::write_out(format_args!($($words)*))?
    };
}

/// Says a line on standard output of what happens while an arm moves, or of what is done already: what
/// cannot be said changes nothing.
macro_rules! tell {
    ($($words:tt)*) => {{
        let _ = $crate::output::write_out(format_args!("{}\n", format_args!($($words)*)));
    }};
}

/// Says a line on standard error, in which programs are called as whoever reads it calls them.
macro_rules! complain {
    ($($words:tt)*) => {
        eprintln!("{}", nullsweep_cell::as_called(format!($($words)*)))
    };
}

pub(super) use {complain, say, say_on, tell};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_stays_and_what_is_not_is_not_made() {
        let folder = tempfile::tempdir().expect("a folder");
        let (old, new) = (folder.path().join("old"), folder.path().join("new"));
        std::fs::write(&old, "kept").expect("written");
        writable(&old).expect("a file");
        writable(&new).expect("a file");
        writable("-".as_ref()).expect("standard output");
        assert_eq!(std::fs::read(&old).expect("a file"), b"kept");
        assert!(!new.exists());
        let nowhere = folder.path().join("no/such/folder");
        let error = writable(&nowhere).expect_err("no folder").to_string();
        assert!(error.contains("no/such/folder"), "{error}");
        writable(folder.path()).expect_err("a folder is no file");
    }
}
