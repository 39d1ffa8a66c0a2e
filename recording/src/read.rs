//! Reading a recording without running it again.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use nullsweep_ipc_types::PlanId;

use crate::record::{CycleRecord, MAGIC, PlanKnot, PlanRecord};
use crate::seal::{Tag, take};

/// What a recording holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Plans that were offered to the loop, in order.
    pub plans: Vec<RecordedPlan>,
    /// Every cycle, in order.
    pub cycles: Vec<CycleRecord>,
}

/// A plan of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedPlan {
    /// Its id; each time that it is published it has another one.
    pub id: PlanId,
    /// Its knots.
    pub knots: Vec<PlanKnot>,
}

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file could not be read.
    #[error("{}: the recording cannot be read", path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It is no recording, or one of another version.
    #[error("{}: not a flight recording of this version", path.display())]
    Format {
        /// Which file.
        path: PathBuf,
    },
}

impl Recording {
    /// Reads a recording up to its last whole record: a process that died leaves a torn one.
    ///
    /// # Errors
    /// Where the file cannot be read or is none of this version.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let bytes =
            fs::read(path).map_err(|source| RecordingError::Read { path: path.into(), source })?;
        Self::parse(&bytes).ok_or_else(|| RecordingError::Format { path: path.into() })
    }

    fn parse(bytes: &[u8]) -> Option<Self> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let mut recording = Self::default();
        while let Some((tag, payload)) = take(&mut rest) {
            match tag {
                Tag::Guard | Tag::Checkpoint => {}
                Tag::Plan => recording.plans.push(plan(payload)?),
                Tag::Cycle => {
                    recording.cycles.push(bytemuck::try_pod_read_unaligned(payload).ok()?);
                }
            }
        }
        Some(recording)
    }
}

fn plan(payload: &[u8]) -> Option<RecordedPlan> {
    let (head, knots) = payload.split_at_checked(size_of::<PlanRecord>())?;
    let head: PlanRecord = bytemuck::pod_read_unaligned(head);
    let knots = knots.chunks(size_of::<PlanKnot>());
    let knots =
        knots.map(|knot| bytemuck::try_pod_read_unaligned(knot).ok()).collect::<Option<_>>();
    Some(RecordedPlan { id: head.id, knots: knots? })
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::seal::put;

    #[test]
    fn a_torn_record_ends_a_recording_and_another_file_is_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("flight-0.nswrec");
        let id = PlanId { epoch: 1, number: 2 };
        let head = PlanRecord { id, ..PlanRecord::zeroed() };
        let knots = [0.0, 1e9].map(|time| PlanKnot { time, ..PlanKnot::zeroed() });
        let cycle = CycleRecord { now_ns: 7, ..CycleRecord::zeroed() };
        let mut bytes = MAGIC.to_vec();
        put(&mut bytes, Tag::Guard, &[b"limits"]);
        put(&mut bytes, Tag::Plan, &[bytemuck::bytes_of(&head), bytemuck::cast_slice(&knots)]);
        put(&mut bytes, Tag::Cycle, &[bytemuck::bytes_of(&cycle)]);
        let whole = bytes.len();
        put(&mut bytes, Tag::Cycle, &[bytemuck::bytes_of(&cycle)]);
        for cut in [whole, whole + 1, bytes.len() - 1] {
            fs::write(&path, &bytes[..cut]).expect("written");
            let found = Recording::read(&path).expect("a recording");
            let plan = RecordedPlan { id, knots: knots.into() };
            assert_eq!(found, Recording { plans: vec![plan], cycles: vec![cycle] });
        }
        fs::write(&path, b"NSWREC5\n").expect("written");
        let told = Recording::read(&path).expect_err("another version").to_string();
        assert!(told.contains("flight-0.nswrec") && told.contains("version"), "{told}");
        let mut short = MAGIC.to_vec();
        put(&mut short, Tag::Cycle, &[&[0; 8]]);
        fs::write(&path, short).expect("written");
        Recording::read(&path).expect_err("a cycle of another size");
    }
}
