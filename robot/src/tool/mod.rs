//! The tool at the end of the arm: what touches the surface, sprays it or looks at it.

mod error;
mod file;
mod footprint;
#[expect(clippy::module_inception, reason = "its noun")]
mod tool;
mod works;

pub use self::error::ToolError;
pub use self::footprint::{Camera, Footprint, Nozzle, Roller, ToolBody};
pub use self::tool::{Mounted, Tool};
