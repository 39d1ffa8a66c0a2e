//! The offline planner of Nullsweep: a scan becomes a joint-space coverage plan.
//!
//! The modules stand in the order in which data passes through them; each is a function from one
//! plain type to the next.

pub mod collision;
pub mod coverage;
pub mod gtsp;
pub mod patches;
pub mod reach;
pub mod report;
pub mod scan;
pub mod simulate;
pub mod surface;
pub mod tool;
pub mod transfer;

mod fit;
mod grid;
