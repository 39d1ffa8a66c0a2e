//! The last gate: the finished plan, checked again from its knots. The command line writes no plan
//! that fails.
//!
//! It gets the plan, the robot and the scene as they were given, and asks nothing of what the search
//! made: it builds its own arm, its own slow collision check over every point and its own surface.
//! What it shares with the search lies below both, see ARCHITECTURE.md. From the plan it takes, beside
//! the knots, where the pad is meant to be on the surface (only there it may touch, and how far it
//! leaves that line is a figure, not a rule), which points belong to reachable patches, and what was
//! swept before.

mod between;
mod collisions;
mod gate;
mod keep_out;
mod kinematics;
mod press;
mod slip;
mod stand_off;
mod violation;

pub use between::between;
pub use gate::{Against, Given, Verification, VerifyError, same_scan, verify};
pub use press::{Press, press_depths};
pub use stand_off::{StandOff, stand_off};
pub use violation::{Violation, ViolationKind};
