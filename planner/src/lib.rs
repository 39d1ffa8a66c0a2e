//! The offline planner of Nullsweep: a scan becomes a joint-space coverage plan.
//!
//! The modules stand in the order in which data passes through them; each is a function from one
//! plain type to the next. [`pipeline::run`] goes the whole way; each stage can be called alone.

pub mod scan;
pub mod simulate;

pub mod patches;
pub mod tool;

pub mod collision;
pub mod reach;
pub mod stance;

pub mod detour;
pub mod graph;
pub mod surface;
pub mod track;

pub mod formulation;
pub mod gtsp;
pub mod joint;

pub mod cost;
pub mod layered;
pub mod motion;
pub mod transfer;

pub mod curve;
pub mod plan;
pub mod timing;

pub mod coverage;
pub mod verify;

pub mod pipeline;
pub mod progress;
pub mod task;

pub mod experiment;

pub mod cli;
pub mod export;
pub mod publish;
pub mod replan;
pub mod report;

mod fit;
mod grid;
