//! The Euclidean graph over the patches whose edges the arm can follow.

mod detour;
mod edge;
pub mod graph;
mod path;
mod track;

pub use edge::{Edge, GraphConfig};
pub use graph::{Graph, Nodes};
pub use path::ToolPath;
pub use track::{Blocked, Track, TrackFailure};
