//! What an operator asks of the executor, and its answer.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use crate::{PlanId, assert_layout, wire_enum};

wire_enum! {
    /// What is asked.
    CommandKind {
        /// Only answer with the present mode.
        Status = 0 => "status",
        /// Slow down to a stand-still on the path and keep the plan.
        Pause = 1 => "pause",
        /// Go on with a paused plan; also allows motion again after a halt.
        Resume = 2 => "resume",
        /// Slow down on the path, drop the plan, hold (category 2).
        Stop = 3 => "stop",
        /// As `Stop`, then ask the endpoint to disable its motors (category 1).
        StopAndDisable = 4 => "stop and disable",
        /// Ramp the speed scale to `value`, 0…1.
        Speed = 5 => "speed",
        /// Clear a latched fault; the arm then holds where it is measured.
        Reset = 6 => "reset",
    }
}

wire_enum! {
    /// How a command was taken.
    Verdict {
        /// Done, or begun.
        Accepted = 0 => "accepted",
        /// Not possible in this mode.
        WrongMode = 1 => "not possible in this mode",
        /// The value is not finite or out of range.
        BadValue = 2 => "the value is out of range",
        /// No such command.
        Unknown = 3 => "unknown command",
        /// The cause of the fault is still there.
        StillFaulty = 4 => "the cause of the fault is still there",
        /// The loop did not take it in time; it is not carried out.
        Busy = 5 => "busy",
    }
}

/// A command.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.Command.v1")]
pub struct Command {
    /// The argument of [`CommandKind::Speed`], 0…1; else 0.
    pub value: f64,
    /// A [`CommandKind`] on the wire.
    pub kind: u32,
    /// Zero.
    pub reserved: u32,
}
assert_layout!(Command, 16);

/// The answer to a command.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.Response.v2")]
pub struct Response {
    /// When it was answered. \[ns\]
    pub stamp_ns: u64,
    /// The plan in execution, [`PlanId::NONE`] for none.
    pub plan: PlanId,
    /// Speed scale asked for, 0…1.
    pub speed_scale: f64,
    /// A [`Verdict`] on the wire.
    pub verdict: u32,
    /// The [`crate::Mode`] on the wire when the command was taken.
    pub mode: u32,
    /// The [`crate::Fault`] on the wire.
    pub fault: u32,
    /// The knot whose segment is being executed; that in which the last plan was left where `stopped`
    /// says so.
    pub knot: u32,
    /// Non-zero: the plan in execution is one that its sender does not call verified, see
    /// [`crate::PlanHeader::verified`].
    pub unverified: u32,
    /// Non-zero: no plan runs, as the last one was ended before its end, in knot `knot`.
    pub stopped: u32,
}
assert_layout!(Response, 56);
