//! The way to the executor and back.

pub mod publish;
pub mod replan;
