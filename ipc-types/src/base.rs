//! What a program asks of whatever moves the robot's base, and the answer.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use crate::{MAX_HELD_JOINTS, assert_layout, wire_enum};

wire_enum! {
    /// What is asked.
    BaseOrder {
        /// Only answer with the present state.
        Status = 0 => "status",
        /// Drive to a pose, and set joints that plans take as fixed, the lift say.
        Drive = 1 => "drive",
        /// The base stands where it was asked to: what a person says who has driven it.
        Arrived = 2 => "arrived",
    }
}

wire_enum! {
    /// How far the base is with what it was asked last.
    BaseState {
        /// It was asked nothing yet.
        Idle = 0 => "idle",
        /// It is on its way.
        Driving = 1 => "driving",
        /// It stands where it was asked to, and the joints are set.
        Arrived = 2 => "arrived",
        /// It has given up and stands.
        Failed = 3 => "failed",
    }
}

/// A joint outside the arms that is to be set.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.BaseJoint.v1")]
pub struct BaseJoint {
    /// Its name in the URDF, UTF-8, filled up with zeros.
    pub name: [u8; 64],
    /// Where it is to be. \[rad\] or \[m\]
    pub position: f64,
}
assert_layout!(BaseJoint, 72);

impl BaseJoint {
    /// A joint by its name; `None` for a name longer than 64 bytes.
    #[must_use]
    pub fn new(name: &str, position: f64) -> Option<Self> {
        let mut joint = Self { position, ..Self::zeroed() };
        joint.name.get_mut(..name.len())?.copy_from_slice(name.as_bytes());
        Some(joint)
    }

    /// Its name; `None` where it is no text.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        let end = self.name.iter().position(|byte| *byte == 0).unwrap_or(self.name.len());
        core::str::from_utf8(&self.name[..end]).ok()
    }
}

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.BaseCommand.v1")]
pub struct BaseCommand {
    /// A number for this drive that whoever asks chooses, not 0: the present time \[ns\] is one that
    /// nobody else has. 0 for other orders.
    pub goal: u64,
    /// Where the robot's root frame is to be in the floor frame: x, y \[m\], yaw \[rad\].
    pub pose: [f64; 3],
    /// Joints that are to be set, before `arrived` is told.
    pub joints: [BaseJoint; MAX_HELD_JOINTS],
    /// How many of `joints` are used.
    pub joint_count: u32,
    /// A [`BaseOrder`] on the wire.
    pub order: u32,
}
assert_layout!(BaseCommand, 2344);

impl BaseCommand {
    /// An order that needs no more than its name.
    #[must_use]
    pub fn of(order: BaseOrder) -> Self {
        Self { order: order.wire(), ..Self::zeroed() }
    }

    /// The joints that are to be set.
    #[must_use]
    pub fn joints(&self) -> &[BaseJoint] {
        &self.joints[..MAX_HELD_JOINTS.min(self.joint_count as usize)]
    }
}

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.BaseStatus.v1")]
pub struct BaseStatus {
    /// When it was answered. \[ns\]
    pub stamp_ns: u64,
    /// The drive that `state` tells of, 0 for none.
    pub goal: u64,
    /// Where the root frame is in the floor frame: x, y \[m\], yaw \[rad\].
    pub pose: [f64; 3],
    /// A [`crate::Verdict`] on the wire: how the order was taken.
    pub verdict: u32,
    /// A [`BaseState`] on the wire.
    pub state: u32,
    /// Non-zero: `pose` is measured. Zero: nobody measures it, and `pose` is where the base was asked
    /// to be.
    pub measured: u32,
    /// Zero.
    pub reserved: u32,
}
assert_layout!(BaseStatus, 56);

#[cfg(test)]
mod tests {
    use std::string::String;

    use super::*;

    #[test]
    fn names_come_back_and_too_long_ones_are_refused() {
        for name in ["torso_lift_joint", "", "Säule", &"x".repeat(64)] {
            assert_eq!(BaseJoint::new(name, 0.2).unwrap().name(), Some(name));
        }
        assert_eq!(BaseJoint::new(&"x".repeat(65), 0.2), None);
        let mut broken = BaseJoint::new(&String::from("torso"), 0.2).unwrap();
        broken.name[1] = 0xff;
        assert_eq!(broken.name(), None);
        // A count from the wire is no length.
        let many = BaseCommand { joint_count: u32::MAX, ..BaseCommand::of(BaseOrder::Drive) };
        assert_eq!(many.joints().len(), MAX_HELD_JOINTS);
    }
}
