//! What the pad sweeps: its motion on the surface and the points that it passes over.

pub mod coverage;
mod pads;
mod segment;

pub use pads::{Pad, contact_motion, pad_motion};
pub use segment::distance_to_segment;
