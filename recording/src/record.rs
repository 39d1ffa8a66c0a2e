//! The records of plans and cycles, byte for byte.

use bytemuck::{Pod, Zeroable};
use nullsweep_ipc_types::PlanId;
use nullsweep_robot::JointVector;

/// The first bytes of a recording; the digit is the version.
pub const MAGIC: &[u8; 8] = b"NSWREC6\n";

/// The state after a cycle was handed over as a checkpoint.
pub const CHECKPOINT: u32 = 1;
/// Cycles before one were lost on the way to whoever writes. No such one is in a recording.
pub const HOLE: u32 = 2;

/// A plan without its knots, which follow it as [`PlanKnot`]s.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct PlanRecord {
    /// Which plan.
    pub id: PlanId,
    /// The plan that it joins, where it joins one at a knot.
    pub join_plan: PlanId,
    /// The knot of that one.
    pub join_knot: u64,
    /// 0 stop, 1 after, 2 knot.
    pub join: u32,
    /// As on the wire.
    pub interpolation: u32,
    /// Whether its velocity may step in corners.
    pub corners: u32,
    /// Whether its sender called it verified.
    pub verified: u32,
    /// How long it waited for its admission. \[s\]
    pub waited: f64,
}

/// A knot as the loop reads it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PlanKnot {
    /// Time since the plan's start, a whole number, exact to 2^53. \[ns\]
    pub time: f64,
    /// Joint positions. \[rad\] or \[m\]
    pub q: JointVector,
    /// Joint velocities, used by cubic segments. \[rad/s\] or \[m/s\]
    pub v: JointVector,
    /// The steepest change of the plan-time rate that keeps every joint within the stop
    /// acceleration from this knot to a cycle past the next one. \[1/s\]
    pub ramp: f64,
}

/// What an endpoint told of its joints.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MeasuredRecord {
    /// When it was measured, on the loop's clock. \[ns\]
    pub stamp_ns: u64,
    /// The setpoint that was in force; 0: none is named.
    pub setpoint_sequence: u64,
    /// \[rad\] or \[m\]
    pub q: JointVector,
    /// How many joints it told of.
    pub joint_count: u32,
    /// As on the wire.
    pub status: u32,
}

/// One cycle: what it got, and the setpoint that it gave.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CycleRecord {
    /// When the loop woke. \[ns\]
    pub now_ns: u64,
    /// The newest state, if there was one.
    pub measured: MeasuredRecord,
    /// The plan that was offered.
    pub offer: PlanId,
    /// The number of the order.
    pub ticket: u64,
    /// The speed that was asked for.
    pub scale: f64,
    /// 0 for none, else which order.
    pub order: u32,
    /// Whether there was a state.
    pub has_measured: u32,
    /// Cycles that were missed before this one.
    pub missed: u32,
    /// Bits of [`CHECKPOINT`] and [`HOLE`].
    pub checkpoint: u32,
    /// The setpoint.
    pub target: TargetRecord,
}

/// A setpoint as plain bytes; sequence 0 for none.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TargetRecord {
    /// Its number.
    pub sequence: u64,
    /// \[rad\] or \[m\]
    pub q: JointVector,
    /// \[rad/s\] or \[m/s\]
    pub v: JointVector,
    /// The plan that runs.
    pub plan: PlanId,
    /// The knot whose segment it is on.
    pub knot: u32,
    /// As on the wire.
    pub mode: u32,
    /// Whether the motors are to be off.
    pub disable: u32,
    /// 0.
    pub reserved: u32,
}
