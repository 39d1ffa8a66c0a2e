//! A command's arguments from words that no shell gave.

use std::ffi::OsString;

use clap::{Args, Parser};

use crate::exit::Usage;

#[derive(Debug, Parser)]
struct Line<A: Args> {
    #[command(flatten)]
    args: A,
}

/// Reads words as a command's arguments, a cell file's values where they say nothing.
pub(super) fn parse<A: Args>(words: &[OsString]) -> anyhow::Result<A> {
    let line = std::iter::once("planner".into()).chain(words.iter().cloned());
    let parsed = nullsweep_cell::parse::<Line<A>>(line, &[], &[]);
    let parsed = parsed.map_err(|error| {
        let text = error.to_string();
        // Usage and hints speak of a command line.
        let told = text.split("\n\n").next().unwrap_or(&text);
        Usage(told.trim_start_matches("error: ").trim().to_owned())
    })?;
    Ok(parsed.args)
}
