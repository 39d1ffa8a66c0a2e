//! Two arms' plans on one clock: each goes along its own path, and waits where the other is in its way.
//!
//! The times of both plans span a plane, the *coordination diagram*: at a point of it the one arm is where
//! its plan has it at the one time, the other where its own has it at the other (`diagram`). A part of
//! the plane is free where it is proven that the arms keep clear of each other all over it. The
//! shortest way through what is free, from both plans' starts to both ends, is the motion of both that takes
//! least time (`least_time`): along the diagonal both move, along an axis one waits. An arm waits where
//! it is at rest, or, at bang-bang velocity, anywhere (`clock`).

mod clock;
mod diagram;
mod error;
mod least_time;
mod together;

pub use error::CoordinateError;
pub use together::{Together, coordinate};
