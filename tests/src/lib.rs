//! The rehearsal stage of Nullsweep: everything that a plan meets before it meets a robot.
//!
//! * [`demo`]: the whole job, from a scan to a swept seat, with a swap of plans mid-motion.
//! * [`mock`]: a simulated arm as a process, made of an [`endpoint`] (setpoints and a time in,
//!   states out), a [`plant`] (a joint [`servo`], or the PR2's [`mechanism`]), the [`judge`] of
//!   every setpoint, and [`fault`]s on request.
//! * [`whole`]: a simulated robot with several arms on a [`base`] that drives.
//!   [`crew`]: it, its executors, and who works through a program.
//! * [`stage`]: processes under one root path; [`parts`]: one program that plays them all;
//!   [`system`]: mock and executor on a stage, from their start to the verdict.
//! * [`sketch`]: joint plans without a surface; [`publisher`]: publishes one as a process.
//! * [`witness`]: watches an executor from outside.
//! * [`conformance`]: whether any endpoint keeps what the executor relies on.
//! * [`latency`]: the latency lab; [`kills`]: the killing lab; [`soak`]: hours of all that can
//!   happen; [`loopback`]: executor and endpoint under a virtual clock.

pub mod arm_args;
pub mod base;
pub mod clock;
pub mod conformance;
pub mod crew;
pub mod demo;
pub mod endpoint;
pub mod fault;
pub mod judge;
pub mod kills;
pub mod latency;
pub mod loopback;
pub mod measured;
pub mod mechanism;
pub mod mock;
pub mod parts;
pub mod plant;
pub mod publisher;
pub mod record;
pub mod servo;
pub mod sketch;
pub mod soak;
pub mod stage;
pub mod system;
pub mod tracking;
pub mod whole;
pub mod witness;
