//! Laying one view onto others: registration by iterative closest points, from coarse to fine.
//!
//! It starts from where the view is said to stand, and from a few places around that, and goes point
//! to plane (Chen & Medioni 1992) with the planes of both sides (Rusinkiewicz 2019), which slides to
//! its place in a few steps. The last levels go point to point (Besl & McKay 1992): where a shape is
//! nearly flat, its ends say more than the sensor's distortion across it. The result comes with how
//! much of the view has a counterpart and how far that is away; a result that these do not bear out
//! is refused.

mod cloud;
mod icp;
mod pairs;
mod result;

pub use icp::register;
pub use result::{RegisterError, Registration};
