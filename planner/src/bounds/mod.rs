//! How far a plan can be from the best one: numbers that no plan of a class passes, whatever order
//! and joint vectors it chooses.

mod cost;
mod coverable;
mod groups;
mod lifts;
mod stops;

pub use cost::{Ascent, Least, least};
pub use coverable::coverable;
pub use lifts::{Pieces, pieces};
pub use stops::Stops;
