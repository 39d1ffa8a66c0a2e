//! What the pad sweeps: its motion on the surface, how fast it goes, and the points that it passes
//! over.

pub mod coverage;
mod deposit;
mod held;
mod missed;
mod pace;
mod pads;
mod passes;
mod percentile;
mod segment;
mod sight;
mod view;
mod visit;

pub use deposit::{Clock, deposits};
pub use held::{Held, Slower};
pub use missed::{Missed, MissedPoints, Unswept, missed};
pub use pace::{DIP, JointPace, Pace};
pub use pads::{Pad, contact_motion, pad_motion};
pub use passes::{Passes, passes_over};
pub(crate) use percentile::percentile;
pub use segment::distance_to_segment;
pub use sight::{Sight, solids};
pub(crate) use visit::visit_swept;
