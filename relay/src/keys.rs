//! The last parts of zenoh's keys, all below `nullsweep/<robot>/relay/`: what access control names.

/// The robot's end says that it is there.
pub const PULSE: &str = "pulse";
/// Telemetry, as it comes.
pub const TELEMETRY: &str = "telemetry";
/// An event, as it comes.
pub const EVENT: &str = "event";

/// Both ends tell their schemas.
pub const HELLO: &str = "hello";
/// What the robot's clock shows.
pub const CLOCK: &str = "clock";
/// A plan is to be executed.
pub const PLAN: &str = "plan";
/// A command is to be carried out.
pub const COMMAND: &str = "command";
/// Events that were missed.
pub const EVENTS: &str = "events";
/// What became of a plan.
pub const OUTCOME: &str = "outcome";

/// What the robot's end is asked.
pub const QUESTIONS: [&str; 6] = [HELLO, CLOCK, PLAN, COMMAND, EVENTS, OUTCOME];

/// Events that a late one still gets, as on one host.
pub const LAST_EVENTS: u64 = nullsweep_ipc_types::service::PLAN_EVENT.history as u64;
