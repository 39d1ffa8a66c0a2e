//! The way to the executor and back.

mod place;
mod pulse;
mod site;

pub mod base;
pub mod journal;
pub mod posture;
pub mod publish;
pub mod replan;

pub use place::{Off, left_at};
pub use pulse::{Loss, Lost};
pub use site::{Post, Site};
