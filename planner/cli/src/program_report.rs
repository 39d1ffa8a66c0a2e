//! What was done of a program, for machines.

use std::path::PathBuf;

use serde::Serialize;

/// What was done, for machines.
#[derive(Debug, Default, Serialize)]
pub(super) struct Report {
    pub(super) program: String,
    pub(super) journal: PathBuf,
    /// Plans of the program, and those that are done.
    pub(super) plans: usize,
    pub(super) done: usize,
    pub(super) stops: Vec<Stood>,
    pub(super) steps: Vec<Step>,
}

/// Where the base stood at a stop.
#[derive(Debug, Serialize)]
pub(super) struct Stood {
    /// From 1.
    pub(super) stop: usize,
    pub(super) base: [f64; 3],
    pub(super) measured: bool,
    pub(super) drove: bool,
    /// How far what is to be swept lay from where the plans have it. \[m\]
    pub(super) off_m: f64,
}

/// A plan that this run had to do with.
#[derive(Debug, Serialize)]
pub(super) struct Step {
    /// From 1.
    pub(super) stop: usize,
    pub(super) plan: usize,
    pub(super) arm: String,
    pub(super) outcome: Outcome,
}

/// What became of it.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Outcome {
    /// From its start to its end.
    Finished,
    /// It had come to its end by itself, nobody waiting for it.
    FoundFinished,
    /// What was left of it was planned anew and swept.
    RestFinished,
    /// It was left where nothing was left to sweep, and the arm brought to where it ends.
    NothingLeft,
    /// From its start once more.
    BegunAgain,
}
