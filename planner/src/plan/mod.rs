//! The plan: what the planner makes, stores and hands on.

pub mod curve;
pub mod export;
mod file;
mod settings;

pub use curve::Curve;
pub use file::*;
pub use settings::{CostKind, Method, Profile};
