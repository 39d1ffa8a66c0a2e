//! What became of a published plan.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use crate::{PlanId, assert_layout, wire_enum};

wire_enum! {
    /// The kind of a [`PlanEvent`]. Every published plan gets one admission (accepted or
    /// rejected) and, once accepted, exactly one end (finished, superseded or aborted).
    EventKind {
        /// Admitted; it will be started by its join rule.
        Accepted = 0 => "accepted",
        /// Not admitted; what was running goes on.
        Rejected = 1 => "rejected",
        /// Its first setpoint was sent. Not an end.
        Started = 2 => "started",
        /// Its last knot was commanded.
        Finished = 3 => "finished",
        /// Another plan took its place.
        Superseded = 4 => "superseded",
        /// It was ended early, see the reason.
        Aborted = 5 => "aborted",
    }
}

wire_enum! {
    /// Why a plan was rejected or aborted. 18 is reserved: it was once given to a reason that
    /// nothing ever sent.
    Reason {
        /// No reason is needed.
        None = 0 => "none",
        /// The payload's counts disagree with its header, or exceed the capacity.
        Malformed = 1 => "malformed message",
        /// The checksum does not fit the content.
        Checksum = 2 => "checksum mismatch",
        /// It was made for another robot or arm.
        Robot = 3 => "made for another robot",
        /// A held joint (torso, other arm) stands elsewhere than the plan assumes.
        HeldJoint = 4 => "a held joint stands elsewhere",
        /// A position, velocity or time is not finite.
        NotFinite = 5 => "a value is not finite",
        /// Times do not start at 0 or do not rise strictly.
        TimeOrder = 6 => "knot times do not rise",
        /// A position leaves the soft limits with their braking margin.
        SoftLimit = 7 => "outside the soft limits",
        /// A segment is faster than a joint's velocity limit.
        Velocity = 8 => "above the velocity limit",
        /// The first knot is not where the arm holds.
        Start = 9 => "does not start where the arm is",
        /// The plan to join is not running.
        JoinPlan = 10 => "the plan to join is not running",
        /// The knot to join does not exist or has passed.
        JoinKnot = 11 => "the knot to join has passed",
        /// The executor is in a fault or has no fresh state.
        NotReady = 12 => "the executor is not ready",
        /// More plans are waiting than the executor can hold.
        QueueFull = 13 => "too many plans are waiting",
        /// It was published before this executor started.
        Epoch = 14 => "published before the executor started",
        /// Stopped by an operator's command.
        Stopped = 15 => "stopped by command",
        /// Ended by a fault, see telemetry.
        Fault = 16 => "ended by a fault",
        /// The executor shut down.
        Shutdown = 17 => "the executor shut down",
        /// A curve speeds a joint up or slows it down by more than its limit.
        Acceleration = 19 => "above the acceleration limit",
        /// A plan of the same id came before: that one alone counts.
        Repeated = 20 => "a plan of this id came before",
        /// The last knot was commanded, but the arm did not come to rest there in time.
        Goal = 21 => "the arm did not come to rest at the plan's end",
        /// A linear plan steps in velocity, and its header does not ask for corners.
        Corner = 22 => "a corner that the plan does not ask for",
        /// A curve changes a joint's acceleration faster than its limit.
        Jerk = 23 => "above the jerk limit",
        /// It begins where the arm is, but at another velocity: in motion where the arm rests, say.
        Speed = 24 => "begins in motion, not at the arm's velocity",
    }
}

/// One step in the life of a plan. For a rejection, `joint`, `knot`, `value` and `bound` say
/// where and by how much; for a plan that was aborted after it had begun, `knot` says where it was left; for an acceptance, `value` is the time from the publication to the end
/// of the check, and `bound` how long the plan takes at full speed. \[s\]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.PlanEvent.v1")]
pub struct PlanEvent {
    /// Rises by one each event.
    pub sequence: u64,
    /// When it happened. \[ns\]
    pub stamp_ns: u64,
    /// Which plan.
    pub plan: PlanId,
    /// The offending value, in the field's unit; NaN where there is none.
    pub value: f64,
    /// The bound that it broke; NaN where there is none.
    pub bound: f64,
    /// An [`EventKind`] on the wire.
    pub kind: u32,
    /// A [`Reason`] on the wire.
    pub reason: u32,
    /// The joint (or held joint), `u32::MAX` where there is none.
    pub joint: u32,
    /// The knot, `u32::MAX` where there is none.
    pub knot: u32,
}
assert_layout!(PlanEvent, 64);
