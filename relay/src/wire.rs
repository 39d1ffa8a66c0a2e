//! What the two ends say to each other, as bytes.
//!
//! Each message begins with the seal of its sender's schema. Whoever reads it looks at that first:
//! bytes of another schema are no message.

use bytemuck::{Pod, Zeroable};
use nullsweep_ipc_types::{Command, PlanEvent, PlanId, Response, Telemetry};

/// A sign of life of the robot's end.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Pulse {
    /// When that end began. \[ns, its `CLOCK_MONOTONIC`\]
    pub began_ns: u64,
    /// How many events its ledger has had.
    pub entries: u64,
    /// Non-zero: an executor runs there.
    pub executor: u64,
}

/// An event in the robot's ledger.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Entry {
    /// Counts them from 1.
    pub index: u64,
    /// The plan's id where it was published; [`PlanId::NONE`] for one that came on no link.
    pub origin: PlanId,
    /// As the executor told it.
    pub event: PlanEvent,
}

/// Goes before a plan's header and knots.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Parcel {
    /// The plan's id for the executor: that of its header, in the robot's time.
    pub id: PlanId,
    /// How old the plan may be when it comes. \[ns\]
    pub within_ns: u64,
}

/// What the robot's end has done with a plan.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Receipt {
    /// A [`Taken`] on the wire.
    pub taken: u64,
    /// How old the plan was when it came. \[ns\]
    pub age_ns: u64,
}

/// Whether a plan was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It is before the executor, whose events say the rest.
    Yes,
    /// There is no executor.
    NoExecutor,
    /// Too many plans wait before the executor.
    Full,
    /// It came too late.
    Late,
    /// It has no knots or too many, or shared memory failed.
    Failed,
    /// It never came.
    Never,
    /// It is not known here, and may have come before this end began.
    Unknown,
}

impl Taken {
    const ALL: [Self; 7] = [
        Self::Yes,
        Self::NoExecutor,
        Self::Full,
        Self::Late,
        Self::Failed,
        Self::Never,
        Self::Unknown,
    ];

    pub fn wire(self) -> u64 {
        self as u64
    }

    pub fn from_wire(value: u64) -> Option<Self> {
        Self::ALL.into_iter().find(|taken| taken.wire() == value)
    }

    /// In words for people.
    pub fn text(self) -> &'static str {
        match self {
            Self::Yes => "taken",
            Self::NoExecutor => "no executor runs at the robot",
            Self::Full => "too many plans wait before the executor",
            Self::Late => "it came too late",
            Self::Failed => "it could not be handed to the executor",
            Self::Never => "it never came to the robot",
            Self::Unknown => "the robot's end has begun anew and does not know it",
        }
    }
}

/// A command under way.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Order {
    /// Not to be carried out later. \[ns, the robot's `CLOCK_MONOTONIC`\]
    pub until_ns: u64,
    pub command: Command,
}

/// Its answer.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Answer {
    /// Zero: it was not given to the executor, and will not be.
    pub asked: u64,
    pub response: Response,
}

/// Telemetry, with the plan's id where it was published.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Snapshot {
    pub origin: PlanId,
    pub telemetry: Telemetry,
}

/// Which events are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct After {
    /// Those behind this one.
    pub index: u64,
}

/// A reading of both clocks: what was asked comes back with the answer.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Reading {
    pub asked_ns: u64,
    pub answered_ns: u64,
}

/// A message: its parts behind the seal.
pub fn sealed(seal: u64, parts: &[&[u8]]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(8 + parts.iter().map(|part| part.len()).sum::<usize>());
    bytes.extend_from_slice(&seal.to_le_bytes());
    for part in parts {
        bytes.extend_from_slice(part);
    }
    bytes
}

/// What is behind the seal; `None` where it is another one.
pub fn opened(seal: u64, bytes: &[u8]) -> Option<&[u8]> {
    let (found, rest) = bytes.split_at_checked(8)?;
    (found == seal.to_le_bytes()).then_some(rest)
}

/// The next value of a message.
pub fn next<T: Pod>(bytes: &mut &[u8]) -> Option<T> {
    let (head, rest) = bytes.split_at_checked(size_of::<T>())?;
    *bytes = rest;
    Some(bytemuck::pod_read_unaligned(head))
}

/// All that is left of a message, as values; `None` where the last one is not whole.
pub fn all<T: Pod>(mut bytes: &[u8]) -> Option<Vec<T>> {
    let mut values = Vec::with_capacity(bytes.len() / size_of::<T>());
    while !bytes.is_empty() {
        values.push(next(&mut bytes)?);
    }
    Some(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_is_read_as_it_was_written_and_only_whole() {
        let after = After { index: 7 };
        let pulse = Pulse { began_ns: 1, entries: 2, executor: 1 };
        let bytes = sealed(9, &[bytemuck::bytes_of(&after), bytemuck::bytes_of(&pulse)]);
        assert_eq!(opened(8, &bytes), None, "another schema");
        assert_eq!(opened(9, &bytes[..7]), None);
        let mut rest = opened(9, &bytes).expect("its own");
        assert_eq!((next(&mut rest), next(&mut rest)), (Some(after), Some(pulse)));
        assert_eq!((rest.len(), next::<After>(&mut rest)), (0, None));
        assert_eq!(all::<After>(&bytes[8..]).map(|all| all.len()), Some(4));
        assert_eq!(all::<Pulse>(&bytes[8..]), None);
    }

    #[test]
    fn what_was_taken_has_a_number() {
        for taken in Taken::ALL {
            assert_eq!(Taken::from_wire(taken.wire()), Some(taken));
        }
        assert_eq!(Taken::from_wire(99), None);
    }
}
