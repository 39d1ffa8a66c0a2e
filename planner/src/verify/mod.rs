//! The last gate: the finished plan, checked again from its knots. A plan that fails is never
//! published.
//!
//! It gets the plan, the robot and the scene as they were given, and asks nothing of what the search
//! made: it builds its own arm, its own slow collision check over every point and its own surface.
//! With the search it shares what lies below both: forward kinematics, link shapes and the pairs of
//! links that are checked, the interpolation between knots and the rule of what the pad covers.

mod collisions;
mod gate;
mod kinematics;
mod violation;

pub use gate::{Given, Verification, VerifyError, verify};
pub use violation::{Violation, ViolationKind};
