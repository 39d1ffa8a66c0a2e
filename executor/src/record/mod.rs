//! The flight recorder: every cycle's input and setpoint, so that what happened can be replayed
//! bit for bit.
//!
//! The loop hands each cycle on through a wait-free queue; the worker writes. A recording begins
//! with the loop's memory at a moment without plans. Two files take turns, so the newest part is
//! always there and the disk does not fill: when one has its size, the recorder changes over at
//! the next moment without plans. What an executor before this one has left stays, under other names,
//! until the next one begins.

mod format;
mod replay;

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;

use crate::admit::ValidPlan;
use crate::cycle::{Checkpoint, Input, State, Target};
use crate::guard::Guard;
use crate::sync::{AtomicBool, AtomicU64, Consumer, Producer, RingBuffer};
use format::GuardRecord;
use nullsweep_recording::{CHECKPOINT, CycleRecord, HOLE, MAGIC, PlanRecord, Tag, put};

pub use replay::{ReplayError, Replayed, replay};

/// Cycles that may wait for the worker: four seconds at 1 kHz.
const WAITING: usize = if cfg!(feature = "model") { 3 } else { 4096 };
/// Bytes that are gathered before they are written.
const CHUNK: usize = 64 << 10;

/// The loop's end of the recorder.
#[derive(Debug)]
pub(crate) struct Tape {
    cycles: Producer<CycleRecord>,
    checkpoints: Producer<Checkpoint>,
    shared: Arc<Shared>,
    /// The last cycle was lost.
    hole: bool,
}

/// What lies between the two ends beside the queues.
#[derive(Debug)]
struct Shared {
    /// The worker wants a checkpoint.
    wanted: AtomicBool,
    /// Cycles that found no room.
    lost: AtomicU64,
}

impl Tape {
    /// Before a cycle: notes what it gets.
    pub(crate) fn input(input: &Input, now_ns: u64) -> CycleRecord {
        format::cycle(input, now_ns)
    }

    /// After it: adds what it gave and hands it on, with the loop's memory where one is wanted.
    pub(crate) fn push(&mut self, mut record: CycleRecord, target: Option<&Target>, state: &State) {
        record.target = format::target(target);
        // Asked first: a checkpoint whose cycle is lost would be in the way of all later ones.
        if self.cycles.is_full() {
            self.hole = true;
            self.shared.lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        if std::mem::take(&mut self.hole) {
            record.checkpoint |= HOLE;
        }
        if self.shared.wanted.load(Ordering::Relaxed)
            && let Some(checkpoint) = state.checkpoint()
            && self.checkpoints.push(checkpoint).is_ok()
        {
            record.checkpoint |= CHECKPOINT;
            self.shared.wanted.store(false, Ordering::Relaxed);
        }
        // There is room: nobody else puts in.
        let _ = self.cycles.push(record);
    }
}

/// The worker's end.
#[derive(Debug)]
pub(crate) struct Recorder {
    cycles: Consumer<CycleRecord>,
    checkpoints: Consumer<Checkpoint>,
    shared: Arc<Shared>,
    folder: PathBuf,
    limit: u64,
    guard: Guard,
    file: Option<File>,
    turn: usize,
    written: u64,
    buffer: Vec<u8>,
    /// Plans that the loop has not taken yet.
    offered: Vec<Arc<ValidPlan>>,
    lost: u64,
}

impl Recorder {
    /// Records into `folder`, two files of about `limit` bytes each, what is put on the tape.
    pub(crate) fn new(folder: &Path, limit: u64, guard: Guard) -> io::Result<(Self, Tape)> {
        fs::create_dir_all(folder)?;
        set_aside(folder)?;
        let (cycle, cycles) = RingBuffer::new(WAITING);
        let (checkpoint, checkpoints) = RingBuffer::new(1);
        let shared = Arc::new(Shared { wanted: AtomicBool::new(true), lost: AtomicU64::new(0) });
        let tape =
            Tape { cycles: cycle, checkpoints: checkpoint, shared: shared.clone(), hole: false };
        let recorder = Self {
            cycles,
            checkpoints,
            shared,
            folder: folder.to_path_buf(),
            limit,
            guard,
            file: None,
            turn: 0,
            written: 0,
            buffer: Vec::with_capacity(2 * CHUNK),
            offered: Vec::new(),
            lost: 0,
        };
        Ok((recorder, tape))
    }

    /// Notes a plan that is about to be offered to the loop.
    pub(crate) fn plan(&mut self, plan: &Arc<ValidPlan>) {
        if self.file.is_some() {
            put_plan(&mut self.buffer, plan);
        }
        self.offered.push(plan.clone());
    }

    /// Forgets a plan that the loop could not be offered.
    pub(crate) fn withdraw(&mut self, plan: &ValidPlan) {
        self.offered.retain(|p| p.id() != plan.id());
    }

    /// Writes what the loop handed on.
    pub(crate) fn round(&mut self) -> io::Result<()> {
        for _ in 0..WAITING {
            let Ok(mut record) = self.cycles.pop() else { break };
            // Told by the cycle itself: a count that is read beforehand may be of too early.
            if record.checkpoint & HOLE != 0 {
                self.begin_anew()?;
                record.checkpoint &= !HOLE;
            }
            if self.file.is_some() {
                put(&mut self.buffer, Tag::Cycle, &[bytemuck::bytes_of(&record)]);
            }
            self.offered.retain(|p| p.id() != record.offer);
            if record.checkpoint & CHECKPOINT != 0
                && let Ok(checkpoint) = self.checkpoints.pop()
            {
                self.change_over(&checkpoint)?;
            }
            if self.buffer.len() >= CHUNK {
                self.write()?;
            }
        }
        if self.written > self.limit && self.file.is_some() {
            self.want_checkpoint();
        }
        if self.written > 2 * self.limit {
            // One endless plan: the bound comes first, and recording goes on after it.
            self.finish()?;
        }
        Ok(())
    }

    /// A recording with a hole cannot be replayed past it: ends it before the hole.
    fn begin_anew(&mut self) -> io::Result<()> {
        let lost = self.shared.lost.load(Ordering::Relaxed);
        tracing::warn!(
            "flight recorder: {} cycles were not written, the recording goes on in another file: a \
             faster disk or less load keeps it whole",
            lost - self.lost
        );
        self.lost = lost;
        self.want_checkpoint();
        self.finish()
    }

    /// Writes what is left.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.write()?;
        self.file = None;
        self.written = 0;
        Ok(())
    }

    fn want_checkpoint(&self) {
        self.shared.wanted.store(true, Ordering::Relaxed);
    }

    fn change_over(&mut self, checkpoint: &Checkpoint) -> io::Result<()> {
        self.finish()?;
        let path = self.folder.join(format!("flight-{}.nswrec", self.turn));
        self.turn = 1 - self.turn;
        self.file = Some(File::create(&path)?);
        tracing::info!("recording to {}", path.display());
        self.buffer.extend_from_slice(MAGIC);
        put(&mut self.buffer, Tag::Guard, &[bytemuck::bytes_of(&GuardRecord::from(&self.guard))]);
        put(&mut self.buffer, Tag::Checkpoint, &[bytemuck::bytes_of(checkpoint)]);
        for plan in &self.offered {
            put_plan(&mut self.buffer, plan);
        }
        self.write()
    }

    fn write(&mut self) -> io::Result<()> {
        if let Some(file) = &mut self.file {
            file.write_all(&self.buffer)?;
            self.written += self.buffer.len() as u64;
        }
        self.buffer.clear();
        Ok(())
    }
}

/// Keeps what was recorded before under other names, in place of what these named.
fn set_aside(folder: &Path) -> io::Result<()> {
    let names = [0, 1].map(|turn| {
        [format!("flight-{turn}.nswrec"), format!("before-{turn}.nswrec")]
            .map(|name| folder.join(name))
    });
    if !names.iter().any(|[flight, _]| flight.exists()) {
        return Ok(());
    }
    for [flight, before] in &names {
        if flight.exists() {
            fs::rename(flight, before)?;
            tracing::info!("the recording before this one is {}", before.display());
        } else if before.exists() {
            fs::remove_file(before)?;
        }
    }
    Ok(())
}

fn put_plan(to: &mut Vec<u8>, plan: &ValidPlan) {
    let head = PlanRecord::from(plan);
    put(to, Tag::Plan, &[bytemuck::bytes_of(&head), bytemuck::cast_slice(plan.knots())]);
}

#[cfg(test)]
mod forged;
#[cfg(test)]
mod tests;
