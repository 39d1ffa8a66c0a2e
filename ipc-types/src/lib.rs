//! What crosses a process boundary in Nullsweep, and nothing else.
//!
//! Every payload is `#[repr(C)]`, of fixed size, without padding and without a pointer, so that
//! the bytes are the same in every process and language. Sizes are asserted at compile time;
//! the version is part of each type's name on the wire. Conventions:
//!
//! * SI units: m, rad, s, N·m. Times are integer nanoseconds on `CLOCK_MONOTONIC` unless the
//!   field's name says that they count from the start of a plan.
//! * Joint arrays have [`MAX_JOINTS`] entries; `joint_count` says how many are used, the rest
//!   are zero. Their order is the arm's chain order, base to tip.
//! * Held joints (torso, the other arm) are those that a plan takes as fixed, in the order of
//!   the robot's URDF. [`MAX_HELD_JOINTS`] entries, `held_count` used.
//! * Everything starts with a sequence number or an id, so that a reader can tell a lost sample
//!   from a late one.
//!
//! The module [`service`] names every service and its quality of service, once, for both sides;
//! with the feature `ports` the module [`ports`] opens them.
#![no_std]
#[cfg(any(test, feature = "ports"))]
extern crate std;

mod base;
mod command;
mod event;
mod plan;
#[cfg(feature = "ports")]
pub mod ports;
pub mod service;
mod setpoint;
mod state;
mod telemetry;

pub use base::{BaseCommand, BaseJoint, BaseOrder, BaseState, BaseStatus};
pub use command::{Command, CommandKind, Response, Verdict};
pub use event::{EventKind, PlanEvent, Reason};
pub use plan::{Contact, Interpolation, JoinRule, Knot, PlanHeader, PlanId, PlanMessage, checksum};
pub use setpoint::Setpoint;
pub use state::{JointStates, status};
pub use telemetry::{Fault, HISTOGRAM_BUCKETS, Mode, Telemetry, bucket_upper_ns};

/// Most joints that an arm can have on the wire.
pub const MAX_JOINTS: usize = 16;

/// Most joints that a plan can take as fixed (torso, other arm).
pub const MAX_HELD_JOINTS: usize = 32;

/// Most knots of one plan: 4.5 MB, so that four publishers fit Docker's 64 MB of shared memory.
pub const MAX_KNOTS: usize = 16_384;

/// One value for each joint of the arm; entries past the joint count are zero. \[rad\] or \[m\]
pub type JointArray = [f64; MAX_JOINTS];

/// Makes a fieldless enum that crosses the wire as a `u32`, with a checked conversion back.
macro_rules! wire_enum {
    ($(#[$meta:meta])* $name:ident { $($(#[$vmeta:meta])* $variant:ident = $value:literal => $text:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name { $($(#[$vmeta])* $variant = $value,)+ }

        impl $name {
            /// Every variant, in wire order.
            pub const ALL: &'static [Self] = &[$(Self::$variant,)+];

            /// The value on the wire.
            #[must_use]
            pub const fn wire(self) -> u32 { self as u32 }

            /// The variant of a value from the wire, `None` for a value of no variant.
            #[must_use]
            pub const fn from_wire(value: u32) -> Option<Self> {
                match value { $($value => Some(Self::$variant),)+ _ => None }
            }

            /// A few words for people.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Self::$variant => $text,)+ }
            }
        }

        impl core::fmt::Display for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.write_str(self.text())
            }
        }
    };
}
pub(crate) use wire_enum;

/// Asserts a payload's size and that an 8-byte alignment holds.
macro_rules! assert_layout {
    ($type:ty, $size:expr) => {
        const _: () = assert!(core::mem::size_of::<$type>() == $size);
        const _: () = assert!(core::mem::align_of::<$type>() == 8);
    };
}
pub(crate) use assert_layout;
