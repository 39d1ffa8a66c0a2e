//! What the executor tells about itself.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use crate::{JointArray, MAX_HELD_JOINTS, PlanId, assert_layout, wire_enum};

wire_enum! {
    /// What the executor is doing.
    Mode {
        /// Waits for a fresh state of a healthy endpoint.
        Init = 0 => "init",
        /// Holds a position.
        Hold = 1 => "hold",
        /// Executes a plan.
        Executing = 2 => "executing",
        /// Has slowed down to a stand-still on the path and keeps the plan.
        Paused = 3 => "paused",
        /// Slows down on the path and drops the plan.
        Stopping = 4 => "stopping",
        /// Holds, latched, until an explicit reset.
        Fault = 5 => "fault",
    }
}

wire_enum! {
    /// Why the executor is in [`Mode::Fault`], or why it stopped. 12 is reserved: it was once given
    /// to a fault that nothing ever told.
    Fault {
        /// None.
        None = 0 => "none",
        /// No fresh joint state: the arm was stopped on its path.
        StaleState = 1 => "joint state is stale",
        /// No joint state at all for the communication budget.
        CommunicationLost = 2 => "communication with the hardware endpoint was lost",
        /// The endpoint halted its motors.
        Halted = 3 => "the hardware endpoint halted",
        /// The endpoint is not calibrated.
        NotCalibrated = 4 => "the hardware endpoint is not calibrated",
        /// The endpoint reports an error or stopped by itself.
        Endpoint = 5 => "the hardware endpoint reports an error",
        /// Commanded and measured positions are too far apart.
        FollowingError = 6 => "following error",
        /// A setpoint would have left the soft limits.
        SoftLimit = 7 => "soft limit",
        /// A setpoint would have stepped further than v·T.
        Step = 8 => "setpoint step above the velocity limit",
        /// A measured or computed value is not finite.
        NotFinite = 9 => "a joint value is not finite",
        /// The mean rate fell below the bound.
        LowRate = 10 => "the loop's mean rate is too low",
        /// A state has another number of joints than the arm.
        JointCount = 11 => "the joint state has another number of joints",
        /// A joint that the running plan takes as fixed has moved: the arm was stopped on its path.
        HeldJoint = 13 => "a held joint has moved",
        /// States come, but for too long they have named no setpoint that can be in force: none,
        /// an old one, or one that was never sent.
        Answer = 14 => "the hardware endpoint does not say which setpoint it follows",
        /// States come, but their stamps are ahead of `CLOCK_MONOTONIC` or far behind it.
        Clock = 15 => "the joint state is not stamped by CLOCK_MONOTONIC",
    }
}

/// How many buckets a latency histogram has; bucket `i` counts values below
/// [`bucket_upper_ns`]`(i)`, the last one everything else.
pub const HISTOGRAM_BUCKETS: usize = 32;

/// The upper bound of a histogram bucket: 2^(i/2 + 8) ns rounded down, 256 ns to 12 ms. \[ns\]
#[must_use]
pub const fn bucket_upper_ns(bucket: usize) -> u64 {
    let octave = 256u64 << (bucket / 2);
    if bucket.is_multiple_of(2) { octave } else { octave + octave * 414 / 1000 }
}

/// A snapshot of the executor, about 100 Hz.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.Telemetry.v5")]
pub struct Telemetry {
    /// Rises by one each sample.
    pub sequence: u64,
    /// When the snapshot was taken. \[ns\]
    pub stamp_ns: u64,
    /// Cycles since the loop was armed.
    pub cycle: u64,
    /// Deadlines that the loop missed since it was armed.
    pub missed_cycles: u64,
    /// Lines of the executor's log that nobody took and that are lost.
    pub lost_lines: u64,
    /// The plan in execution, [`PlanId::NONE`] for none.
    pub plan: PlanId,
    /// Time within that plan. \[ns\]
    pub plan_time_ns: u64,
    /// Speed scale in force, 0…1.
    pub speed_scale: f64,
    /// Commanded positions. \[rad\] or \[m\]
    pub commanded: JointArray,
    /// Newest measured positions. \[rad\] or \[m\]
    pub measured: JointArray,
    /// Histogram of wake-up lateness, see [`bucket_upper_ns`].
    pub lateness: [u32; HISTOGRAM_BUCKETS],
    /// Histogram of compute time a cycle.
    pub compute: [u32; HISTOGRAM_BUCKETS],
    /// Histogram of the time from a setpoint to the cycle that first reads a state in which the
    /// endpoint says that it had it.
    pub round_trip: [u32; HISTOGRAM_BUCKETS],
    /// How many joints are used.
    pub joint_count: u32,
    /// A [`Mode`] on the wire.
    pub mode: u32,
    /// A [`Fault`] on the wire.
    pub fault: u32,
    /// The knot whose segment is being executed; that in which the last plan was left where `stopped`
    /// says so.
    pub knot: u32,
    /// Non-zero: the plan in execution is one that its sender does not call verified, see
    /// [`crate::PlanHeader::verified`].
    pub unverified: u32,
    /// Non-zero: no plan runs, as the last one was ended before its end, in knot `knot`.
    pub stopped: u32,
    /// How many of `held_positions` are used; 0 before the first state.
    pub held_count: u32,
    /// Zero.
    pub reserved: u32,
    /// Newest measured positions of the joints that a plan takes as fixed, in the URDF's order. \[rad\]
    /// or \[m\]
    pub held_positions: [f64; MAX_HELD_JOINTS],
}
assert_layout!(Telemetry, 1000);
