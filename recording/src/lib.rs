//! Flight recordings as files: what the executor writes of each cycle, and what others read of it.
//!
//! A recording is a row of sealed records, so what a torn or forged one holds is told from what was
//! written. The executor replays it through its own loop; [`Recording`] only reads which plans were
//! there, what was commanded and what was measured.

mod read;
mod record;
mod seal;

pub use read::{RecordedPlan, Recording, RecordingError};
pub use record::{
    CHECKPOINT, CycleRecord, HOLE, MAGIC, MeasuredRecord, PlanKnot, PlanRecord, TargetRecord,
};
pub use seal::{Tag, put, take};
