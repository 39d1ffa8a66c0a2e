//! The joint path through the tour's poses.

pub mod layered;
pub mod mover;
pub mod transfer;
