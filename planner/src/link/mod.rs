//! The way to the executor and back.

mod pulse;

pub mod publish;
pub mod replan;

pub use pulse::{Loss, Lost};
