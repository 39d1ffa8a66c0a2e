//! What the executor asks of the hardware endpoint, every cycle.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use crate::{JointArray, PlanId, assert_layout};

/// Where the joints shall be at the end of the coming cycle. An endpoint follows the newest one
/// and stops by itself when none has come by `deadline_ns` plus its own grace (20 ms).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.Setpoint.v1")]
pub struct Setpoint {
    /// Rises by one each cycle. A reader that skips samples judges steps by v·T·Δsequence.
    pub sequence: u64,
    /// When the executor sent it. \[ns\]
    pub stamp_ns: u64,
    /// When the next one is due. \[ns\]
    pub deadline_ns: u64,
    /// The plan that is being executed, [`PlanId::NONE`] while holding without one.
    pub plan: PlanId,
    /// Commanded positions. \[rad\] or \[m\]
    pub positions: JointArray,
    /// Commanded velocities, feed-forward for the endpoint's servo. \[rad/s\] or \[m/s\]
    pub velocities: JointArray,
    /// How many joints are used.
    pub joint_count: u32,
    /// The executor's [`crate::Mode`] on the wire.
    pub mode: u32,
    /// The knot whose segment is being executed.
    pub knot: u32,
    /// Non-zero asks the endpoint to disable its motors (stop category 1, shutdown).
    pub disable: u32,
}
assert_layout!(Setpoint, 312);
