//! The finished plan, checked again: a plan that fails is never published.

mod collisions;
mod gate;
mod kinematics;
mod violation;

pub use gate::{Verification, verify};
pub use violation::{Violation, ViolationKind};
