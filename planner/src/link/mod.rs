//! The way to the executor and back.

mod pulse;
mod site;

pub mod posture;
pub mod publish;
pub mod replan;

pub use pulse::{Loss, Lost};
pub use site::Site;
