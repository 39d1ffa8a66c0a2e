//! What the hardware endpoint measures.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use crate::{JointArray, MAX_HELD_JOINTS, assert_layout};

/// Bits of [`JointStates::status`].
pub mod status {
    /// Every joint of the arm is calibrated.
    pub const CALIBRATED: u32 = 1;
    /// The motors are halted (run stop, communication error, halt service).
    pub const HALTED: u32 = 1 << 1;
    /// The endpoint follows no setpoint: they ceased and it stopped by itself, or those that come
    /// begin too far from where it measures the arm.
    pub const SETPOINT_TIMEOUT: u32 = 1 << 2;
    /// An endpoint error that latches until it is reset there.
    pub const ERROR: u32 = 1 << 3;
}

/// The measured joints and the endpoint's status, about 1 kHz.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.JointStates.v1")]
pub struct JointStates {
    /// Rises by one each sample.
    pub sequence: u64,
    /// When the joints were measured. \[ns\]
    pub stamp_ns: u64,
    /// The newest setpoint that was in force when the joints were measured, 0 for none.
    pub setpoint_sequence: u64,
    /// When that setpoint reached the endpoint. \[ns\]
    pub setpoint_received_ns: u64,
    /// Measured positions. \[rad\] or \[m\]
    pub positions: JointArray,
    /// Measured velocities. \[rad/s\] or \[m/s\]
    pub velocities: JointArray,
    /// Measured efforts. \[N·m\] or \[N\]
    pub efforts: JointArray,
    /// Positions of the joints that a plan takes as fixed, in the URDF's order. \[rad\] or \[m\]
    pub held_positions: [f64; MAX_HELD_JOINTS],
    /// How many of `held_positions` are used.
    pub held_count: u32,
    /// How many joints are used.
    pub joint_count: u32,
    /// Bits of [`status`].
    pub status: u32,
    /// Zero.
    pub reserved: u32,
}
assert_layout!(JointStates, 688);
