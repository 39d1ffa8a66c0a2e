//! The plan: what the planner makes, stores and hands on.

mod bounds;
mod curve;
mod error;
pub mod export;
mod file;
mod kind;
mod knot;
mod message;
mod program;
mod seal;
mod settings;
mod surface;
mod trajectory;

pub use curve::Curve;
pub use error::{FORMAT, PROGRAM_FORMAT, PlanError};
pub use file::{Continues, Held, Left, Plan, Stretch, SurfaceSample};
pub use knot::PlanKnot;
pub use program::{Program, ProgramStop, Totals, Unswept, Work};
pub use seal::Seal;
pub use settings::{BLEND_TOLERANCE, CostKind, LIFT, LINE_TOLERANCE, Method, Profile};
pub use trajectory::{Trajectory, TrajectoryCursor};
