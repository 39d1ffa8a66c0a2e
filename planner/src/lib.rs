//! The offline planner of Nullsweep: a scan becomes a joint-space coverage plan.
//!
//! The modules stand in the order in which data passes through them; each is a function from one
//! plain type to the next. [`pipeline::run`] goes the whole way; each stage can be called alone.

pub mod cost;
pub mod progress;

pub mod workcell;

pub mod plan;
pub mod roadmap;

pub mod sweep;

pub mod motion;
pub mod timing;
pub mod tour;

pub mod verify;

pub mod link;
pub mod pipeline;
pub mod task;
