//! Planning through given tool poses instead of a scan: in which order, and with which joint
//! vectors, the arm meets every pose within its tolerance with the least joint movement.
//!
//! The order is free and the path open, as in Wang and Gleicher's arm-coverage planner (ICRA
//! 2025), whose measures [`TaskFigures`] holds beside ours.

mod assemble;
mod config;
mod error;
mod figures;
mod read;
mod route;
mod run;
mod search;
mod space;
mod tolerance;

pub use config::{TaskConfig, floor_under, tip_tool};
pub use error::TaskError;
pub use figures::TaskFigures;
pub use read::{Poses, PosesError, read};
pub use run::{TaskOutcome, run};
pub use tolerance::Tolerance;
