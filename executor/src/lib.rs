//! Fixed-rate real-time executor of Nullsweep: a plan becomes joint setpoints.
//!
//! Three threads. The real-time thread runs [`cycle::step`] once a period and nothing else; the
//! service thread answers commands and tells telemetry and events; the worker thread admits
//! plans. Bounded lock-free queues lie between them.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x <= bound)` is how a NaN falls on the safe side"
)]

mod admit;
pub mod cycle;
mod guard;
mod interpolate;
mod path;
#[cfg(test)]
mod testing;

pub use admit::{Held, Join, Rejection, Rules, ValidPlan, admit};
pub use guard::{Guard, JointGuard, Joints};
pub use interpolate::{PlanKnot, Sample, reach, sample, top_speed};
pub use nullsweep_robot::MAX_DOF;
pub use path::{Path, Progress};
