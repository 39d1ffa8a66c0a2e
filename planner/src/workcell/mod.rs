//! The arm in its place: what it reaches, and where the robot stands.

mod bed;
mod contact;
mod free;
mod obstruction;
mod reach;
mod sample;
mod scene;
pub mod stance;

pub use bed::{Bed, FACED};
pub use contact::{contact_pose, direction, heading_of, tangents};
pub use free::nearest_free;
pub use obstruction::{Cause, Obstruction, obstruction};
pub use reach::reach;
pub use sample::{Sample, Workcell, middle_out, redundancies};
pub use scene::Scene;
pub use stance::{Stance, StanceSearch};
