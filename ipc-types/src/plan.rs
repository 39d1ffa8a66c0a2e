//! A plan on the wire: a header and its knots.

use bytemuck::{Pod, Zeroable};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;
use xxhash_rust::xxh3::Xxh3;

use crate::{JointArray, MAX_HELD_JOINTS, MAX_KNOTS, assert_layout, wire_enum};

/// Names one published plan: when it was published (`CLOCK_MONOTONIC`, ns) and a counter within its
/// publisher. No id is ever repeated, and an executor never starts a plan whose epoch lies before
/// its own start. Zero means "no plan".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.PlanId.v1")]
pub struct PlanId {
    /// When it was published. \[ns, `CLOCK_MONOTONIC`\]
    pub epoch: u64,
    /// Counts that publisher's plans from 1.
    pub number: u64,
}
assert_layout!(PlanId, 16);

impl PlanId {
    /// The id of no plan.
    pub const NONE: Self = Self { epoch: 0, number: 0 };

    /// Whether this names a plan at all.
    #[must_use]
    pub fn is_some(self) -> bool {
        self != Self::NONE
    }
}

impl core::fmt::Display for PlanId {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:x}/{}", self.epoch, self.number)
    }
}

wire_enum! {
    /// How the executor moves between two knots.
    Interpolation {
        /// Straight joint lines at constant velocity: bang-bang velocity.
        Linear = 0 => "linear",
        /// Cubic Hermite through positions and velocities.
        Cubic = 1 => "cubic",
    }
}

wire_enum! {
    /// How a plan joins the motion that is going on.
    JoinRule {
        /// Stop on the running plan's path, then start if the first knot is where the arm holds.
        StopThenStart = 0 => "stop",
        /// Start when the running plan has ended.
        AfterCurrent = 1 => "after",
        /// Start in the running plan's knot `join_knot`, without a stop.
        AtKnot = 2 => "knot",
    }
}

wire_enum! {
    /// What the tool does in the segment that ends in a knot.
    Contact {
        /// The pad is on the surface.
        Contact = 0 => "contact",
        /// The tool moves to, from or between pieces, off the surface.
        Transfer = 1 => "transfer",
    }
}

/// One knot of a plan: where the arm is at a time. trajectory_msgs/JointTrajectoryPoint's
/// convention: the times of a plan rise strictly, the first is 0.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.Knot.v1")]
pub struct Knot {
    /// Time since the plan's start. \[ns\]
    pub time_from_start_ns: u64,
    /// Joint positions; continuous joints are unwrapped along the whole plan, and none is further
    /// from 0 than [`Self::FARTHEST`]. \[rad\] or \[m\]
    pub positions: JointArray,
    /// Joint velocities, used by [`Interpolation::Cubic`], else zero. \[rad/s\] or \[m/s\]
    pub velocities: JointArray,
    /// The patch that this knot sweeps, `u32::MAX` for none.
    pub patch: u32,
    /// A [`Contact`] on the wire.
    pub contact: u32,
}
assert_layout!(Knot, 272);

impl Knot {
    /// A knot's `patch` where it sweeps none.
    pub const NO_PATCH: u32 = u32::MAX;
    /// How far from 0 a joint may be, continuous ones too: some 160 turns. Further out whole turns
    /// cannot be told from others to the last digits that the start tolerance needs.
    /// \[rad\] or \[m\]
    pub const FARTHEST: f64 = 1000.0;
    /// The latest time: whole nanoseconds that an `f64` holds, 104 days. \[ns\]
    pub const LATEST_NS: u64 = 1 << 53;
}

/// What the executor must know of a plan before it admits it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[repr(C)]
#[type_name("nullsweep.PlanHeader.v3")]
pub struct PlanHeader {
    /// This plan.
    pub id: PlanId,
    /// The plan whose knot is joined, for [`JoinRule::AtKnot`]; else [`PlanId::NONE`].
    pub join_plan: PlanId,
    /// Fingerprint of the robot's URDF and arm, as `robot` computes it.
    pub fingerprint: u64,
    /// Checksum of the header (this field as zero) and the knots, see [`checksum`].
    pub checksum: u64,
    /// Fingerprint of the tool that the plan was made for; for the record.
    pub tool: u64,
    /// The robot's root frame in the frame that the planner was given: x, y, z \[m\] and the unit
    /// quaternion x, y, z, w. For the record: the executor knows no geometry.
    pub base_pose: [f64; 7],
    /// Positions of the held joints that the plan was checked with. \[rad\] or \[m\]
    pub held_positions: [f64; MAX_HELD_JOINTS],
    /// How many of `held_positions` are used.
    pub held_count: u32,
    /// How many joints each knot has.
    pub joint_count: u32,
    /// How many knots follow.
    pub knot_count: u32,
    /// An [`Interpolation`] on the wire.
    pub interpolation: u32,
    /// A [`JoinRule`] on the wire.
    pub join_rule: u32,
    /// The knot of `join_plan` in which this plan starts, for [`JoinRule::AtKnot`].
    pub join_knot: u32,
    /// Non-zero: the velocity may step in every knot of a [`Interpolation::Linear`] plan, in the
    /// first and the last one too: bang-bang. Zero: it steps by no more than the joints may change
    /// it in a cycle.
    pub corners: u32,
    /// Non-zero: the planner's last check passed this very plan. Zero: its sender does not say so,
    /// and while it runs the executor tells everybody that it is not verified.
    pub verified: u32,
}
assert_layout!(PlanHeader, 400);

impl Default for PlanHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}

/// A whole plan in memory, as it is published. The message that [`checksum`] seals.
#[derive(Clone, Copy, Debug)]
pub struct PlanMessage<'a> {
    /// What the executor checks first.
    pub header: &'a PlanHeader,
    /// At most [`MAX_KNOTS`] knots.
    pub knots: &'a [Knot],
}

/// The xxh3 checksum of a header (its `checksum` taken as zero) followed by its knots.
#[must_use]
pub fn checksum(message: PlanMessage<'_>) -> u64 {
    let header = PlanHeader { checksum: 0, ..*message.header };
    let mut hash = Xxh3::new();
    hash.update(bytemuck::bytes_of(&header));
    hash.update(bytemuck::cast_slice(message.knots));
    hash.digest()
}

const _: () = assert!(MAX_KNOTS * size_of::<Knot>() < 5 << 20);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksum_sees_every_field() {
        let header = PlanHeader { joint_count: 7, knot_count: 2, ..PlanHeader::default() };
        let knots = [Knot::zeroed(); 2];
        let seal = |h: &PlanHeader, k: &[Knot]| checksum(PlanMessage { header: h, knots: k });
        let reference = seal(&header, &knots);
        assert_eq!(reference, seal(&PlanHeader { checksum: 9, ..header }, &knots));

        let mut bytes = [0u8; size_of::<PlanHeader>()];
        bytes.copy_from_slice(bytemuck::bytes_of(&header));
        let own = core::mem::offset_of!(PlanHeader, checksum);
        for i in (0..bytes.len()).filter(|i| !(own..own + 8).contains(i)) {
            bytes[i] ^= 1;
            let changed: PlanHeader = bytemuck::pod_read_unaligned(&bytes);
            assert_ne!(reference, seal(&changed, &knots), "header byte {i}");
            bytes[i] ^= 1;
        }
        let mut changed = knots;
        changed[1].positions[6] = 1e-300;
        assert_ne!(reference, seal(&header, &changed));
    }
}
