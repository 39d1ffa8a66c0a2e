//! Laying one view onto others: registration by iterative closest points, from coarse to fine.
//!
//! It starts from where the view is said to stand, and from a few places around that, and goes point
//! to plane (Chen & Medioni 1992) with the planes of both sides (Rusinkiewicz 2019), which slides to
//! its place in a few steps. The last levels go point to point (Besl & McKay 1992), each pair weighed
//! by the noise of both sensors (Segal et al. 2009): a depth camera is surer across its rays than
//! along them, so where a shape is nearly flat its ends say more than what the camera's distortion
//! does to it. There both sides look for counterparts, so that an edge that only one of them has seen
//! draws nothing aside. The result comes with how much of the view has a counterpart and how far that
//! is away; a result that these do not bear out is refused.

mod cloud;
mod icp;
mod pairs;
mod result;

pub use icp::register;
pub use result::{RegisterError, Registration};
