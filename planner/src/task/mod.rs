//! Planning through given tool poses instead of a scan: in which order, and with which joint
//! vectors, the arm meets every pose within its tolerance with the least joint movement.
//!
//! The order is free and the path open, as in Wang and Gleicher's arm-coverage planner (ICRA
//! 2025), whose measures [`TaskFigures`] holds beside ours.

mod config;
mod error;
mod figures;
mod route;
mod run;
mod search;

pub use config::TaskConfig;
pub use error::TaskError;
pub use figures::TaskFigures;
pub use run::{TaskOutcome, run};
