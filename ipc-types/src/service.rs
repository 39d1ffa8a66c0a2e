//! Every service's name and quality of service: the one table that both sides read.
//!
//! | service | payload | publishers → subscribers | buffer | history |
//! |---|---|---|---|---|
//! | `nullsweep/<robot>/plan` | `[Knot]`, user header `PlanHeader` | 4 → 1 | 4 | 0 |
//! | `nullsweep/<robot>/setpoint` | `Setpoint` | 1 → 1 | 64 | 0 |
//! | `nullsweep/<robot>/state` | `JointStates` | 1 → 1 | 64 | 0 |
//! | `nullsweep/<robot>/telemetry` | `Telemetry` | 1 → 8 | 64 | 1 |
//! | `nullsweep/<robot>/plan_event` | `PlanEvent` | 1 → 8 | 64 | 16 |
//! | `nullsweep/<robot>/command` | `Command` → `Response` | 4 clients, 1 server | 4 | – |
//! | `nullsweep/<robot>/base` | `BaseCommand` → `BaseStatus` | 4 clients, 1 server | 4 | – |
//!
//! Allocation is static everywhere and no send ever blocks. A plan overflows nowhere: what does
//! not fit is discarded and the publisher is told. Streams of states overwrite the oldest.

/// The quality of service of one publish-subscribe service.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Last part of the service's name.
    pub name: &'static str,
    /// Most publishers.
    pub publishers: usize,
    /// Most subscribers.
    pub subscribers: usize,
    /// Samples that a subscriber's buffer holds.
    pub buffer: usize,
    /// Samples that a late subscriber still gets.
    pub history: usize,
    /// Samples that a subscriber may hold at once.
    pub borrowed: usize,
    /// Whether a full buffer drops its oldest sample (else the new one is discarded).
    pub overflow: bool,
}

/// Plans, planner to executor.
pub const PLAN: Qos = Qos {
    name: "plan",
    publishers: 4,
    subscribers: 1,
    buffer: 4,
    history: 0,
    borrowed: 2,
    overflow: false,
};
/// Setpoints, executor to hardware endpoint.
pub const SETPOINT: Qos = Qos {
    name: "setpoint",
    publishers: 1,
    subscribers: 1,
    buffer: 64,
    history: 0,
    borrowed: 2,
    overflow: true,
};
/// Joint states, hardware endpoint to executor.
pub const STATE: Qos = Qos {
    name: "state",
    publishers: 1,
    subscribers: 1,
    buffer: 64,
    history: 0,
    borrowed: 2,
    overflow: true,
};
/// Telemetry, executor to anybody.
pub const TELEMETRY: Qos = Qos {
    name: "telemetry",
    publishers: 1,
    subscribers: 8,
    buffer: 64,
    history: 1,
    borrowed: 2,
    overflow: true,
};
/// Plan events, executor to anybody.
pub const PLAN_EVENT: Qos = Qos {
    name: "plan_event",
    publishers: 1,
    subscribers: 8,
    buffer: 64,
    history: 16,
    borrowed: 2,
    overflow: true,
};
/// Last part of the command service's name.
pub const COMMAND: &str = "command";
/// Most clients of the command service.
pub const COMMAND_CLIENTS: usize = 4;
/// Questions that one of them may have open.
pub const COMMAND_REQUESTS: usize = 4;
/// Last part of the name of the service of what moves the robot's base.
pub const BASE: &str = "base";
/// Most clients of the base service.
pub const BASE_CLIENTS: usize = 4;
/// Questions that one of them may have open.
pub const BASE_REQUESTS: usize = 4;
/// Nodes (processes) that may open one service at once.
pub const MAX_NODES: usize = 20;
/// The robot's name in the service names where none is given.
pub const DEFAULT_ROBOT: &str = "pr2";
