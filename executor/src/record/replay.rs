//! Replays a recording through the very function that made it.

use std::collections::HashMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nullsweep_ipc_types::{EventKind, PlanId};
use nullsweep_recording::{CycleRecord, MAGIC, Tag, take};

use super::format::{self, GuardRecord};
use crate::cycle::{Checkpoint, Event, State, step};
use crate::guard::Guard;

/// Why a recording could not be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It could not be read.
    #[error("{}: {error}", .path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// It is no recording, or one of another version.
    #[error("{}: not a flight recording of this version", .path.display())]
    Format {
        /// Which file.
        path: PathBuf,
    },
    /// A cycle names a plan that is not in the recording.
    #[error("cycle {cycle}: plan {plan} is not in the recording")]
    MissingPlan {
        /// Which cycle of the recording, from 1.
        cycle: u64,
        /// Which plan.
        plan: PlanId,
    },
    /// A setpoint came out otherwise.
    #[error("cycle {cycle}: setpoint {sequence} differs from the recorded one")]
    Differs {
        /// Which cycle of the recording, from 1.
        cycle: u64,
        /// The recorded setpoint's number.
        sequence: u64,
    },
}

/// What a replay found: every setpoint was bit-identical.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Cycles that were replayed.
    pub cycles: u64,
    /// Setpoints that were compared.
    pub setpoints: u64,
    /// What became of plans, in order, with the cycle.
    pub events: Vec<(u64, Event)>,
    /// Bytes after the last whole record: a process that died writing leaves some.
    pub torn: usize,
}

impl Replayed {
    /// How many events of a kind there were.
    #[must_use]
    pub fn count(&self, kind: EventKind) -> usize {
        self.events.iter().filter(|(_, e)| e.kind == kind).count()
    }
}

/// Replays a recording and compares every setpoint bit for bit.
///
/// # Errors
/// When it is no recording, or the first setpoint that differs.
pub fn replay(path: &Path) -> Result<Replayed, ReplayError> {
    let bytes =
        fs::read(path).map_err(|error| ReplayError::Read { path: path.to_path_buf(), error })?;
    let no_recording = || ReplayError::Format { path: path.to_path_buf() };
    let mut rest = bytes.strip_prefix(MAGIC).ok_or_else(no_recording)?;
    let guard = match take(&mut rest) {
        Some((Tag::Guard, payload)) => {
            let record: &GuardRecord = &read(payload).ok_or_else(no_recording)?;
            Guard::from(record)
        }
        _ => return Err(no_recording()),
    };
    let mut state = match take(&mut rest) {
        Some((Tag::Checkpoint, payload)) => {
            read::<Checkpoint>(payload).and_then(|c| State::restore(&c)).ok_or_else(no_recording)?
        }
        _ => return Err(no_recording()),
    };
    let mut plans = HashMap::new();
    let mut replayed = Replayed::default();
    while let Some((tag, payload)) = take(&mut rest) {
        match tag {
            Tag::Plan => {
                let plan = format::plan(payload).ok_or_else(no_recording)?;
                plans.insert(plan.id(), Arc::new(plan));
            }
            Tag::Cycle => {
                let record: CycleRecord = read(payload).ok_or_else(no_recording)?;
                replayed.cycles += 1;
                let cycle = replayed.cycles;
                let mut input = format::input(&record).ok_or_else(no_recording)?;
                if record.offer.is_some() {
                    let plan = plans.remove(&record.offer);
                    let missing = ReplayError::MissingPlan { cycle, plan: record.offer };
                    input.offer = Some(plan.ok_or(missing)?);
                }
                let out = step(&mut state, input, record.now_ns, &guard);
                let target = format::target(out.setpoint.as_ref());
                // Bytes, not values: a NaN or a negative zero must be the same one.
                if bytemuck::bytes_of(&target) != bytemuck::bytes_of(&record.target) {
                    let sequence = record.target.sequence;
                    return Err(ReplayError::Differs { cycle, sequence });
                }
                replayed.setpoints += u64::from(record.target.sequence > 0);
                replayed.events.extend(out.events.iter().map(|e| (cycle, *e)));
            }
            Tag::Guard | Tag::Checkpoint => return Err(no_recording()),
        }
    }
    replayed.torn = rest.len();
    Ok(replayed)
}

fn read<T: bytemuck::AnyBitPattern>(payload: &[u8]) -> Option<T> {
    bytemuck::try_pod_read_unaligned(payload).ok()
}
