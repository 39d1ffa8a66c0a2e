//! Fixed-rate real-time executor of Nullsweep: a plan becomes joint setpoints.
//!
//! Three threads. The real-time thread runs [`cycle::step`] once a period and nothing else; the
//! service thread answers commands and tells telemetry and events; the worker thread admits
//! plans. Bounded wait-free queues lie between them.
#![allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "`!(x <= bound)` is how a NaN falls on the safe side"
)]

mod admit;
mod alarm;
mod cli;
mod ctl;
pub mod cycle;
mod desk;
mod driver;
mod executor;
mod fit;
mod guard;
mod hardware;
mod ids;
mod interpolate;
mod journal;
pub mod log;
#[cfg(all(test, feature = "model"))]
mod models;
mod path;
mod pidfile;
mod record;
pub mod rt;
mod service;
mod slots;
#[cfg(test)]
mod swaps;
mod sync;
mod system;
#[cfg(test)]
mod testing;
mod top;
mod total;
mod words;
mod worker;

pub use admit::{Held, Join, Rejection, Rules, ValidPlan, admit};
pub use alarm::Alarm;
pub use cli::main_with;
pub use driver::Driver;
pub use executor::{Config, ExecutorError, Summary, quantile_ns, run};
pub use fit::{joins_at, starts_at};
pub use guard::{Guard, JointGuard};
pub use hardware::{Hardware, IpcHardware, Loopback};
pub use ids::Ids;
pub use interpolate::{
    PlanKnot, Sample, ends, reach, sample, top_acceleration, top_jerk, top_speed,
};
pub use nullsweep_robot::{JointVector, MAX_DOF};
pub use path::{Path, Progress};
pub use record::{ReplayError, Replayed, replay};
pub use rt::PoolAllocator;
pub use slots::{Claim, LoopEnd, Report, ServiceEnd, Slots, WorkerEnd};
