//! What of a scene is to be swept, how often and how fast, what the tool keeps out of, and what nothing
//! of the robot enters.
//!
//! A file ([`Spec`]) names volumes, picked objects and painted colours; with the scan that it speaks of it
//! becomes [`Regions`], which tell of any point where it belongs ([`Label`]), what is to be swept in
//! which order ([`Round`]), and which solids are in the way. They are a part of the
//! [`Scene`](crate::workcell::Scene) and move with it.

mod error;
mod figures;
mod marked;
mod region;
mod spec;
mod volume;

pub use error::RegionError;
pub use figures::RegionFigures;
pub use marked::Marked;
pub use region::{Kind, Label, Mark, Region, Regions, Round, Sweep};
pub use spec::{Around, Spec};
pub use volume::{Shape, Volume};
