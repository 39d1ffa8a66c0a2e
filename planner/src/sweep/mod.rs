//! What the pad sweeps: its motion on the surface and the points that it passes over.

pub mod coverage;
mod pads;

pub use pads::{Pad, contact_motion, pad_motion};
