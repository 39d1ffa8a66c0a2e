//! The loop's memory as plain bytes, taken while no plan is there: where a recording can begin.

use bytemuck::{Pod, Zeroable};
use nullsweep_ipc_types::{Fault, Mode};
use nullsweep_recording::MeasuredRecord;

use super::exchange::{Measured, Refused};
use super::state::{REMEMBERED, State, small};
use super::watch::Watch;
use crate::JointVector;

/// A [`State`] without plans.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Checkpoint {
    cycle: u64,
    missed: u64,
    sequence: u64,
    scale: f64,
    q: JointVector,
    v: JointVector,
    mode: u32,
    fault: u32,
    has_position: u32,
    paused: u32,
    disabled: u32,
    shutdown: u32,
    following: u32,
    unheard: u32,
    has_measured: u32,
    window_cycles: u32,
    measured: MeasuredRecord,
    fresh_ns: u64,
    answered: u64,
    refused: u64,
    refused_ns: u64,
    refused_ahead_ns: i64,
    window_start_ns: u64,
    windows: u64,
    rates: [f64; 3],
    remembered: [JointVector; REMEMBERED],
    remembered_v: [JointVector; REMEMBERED],
}

impl From<&Measured> for MeasuredRecord {
    fn from(m: &Measured) -> Self {
        Self {
            stamp_ns: m.stamp_ns,
            setpoint_sequence: m.setpoint_sequence,
            q: m.q,
            joint_count: small(m.joint_count),
            status: m.status,
        }
    }
}

impl From<&MeasuredRecord> for Measured {
    fn from(m: &MeasuredRecord) -> Self {
        Self {
            stamp_ns: m.stamp_ns,
            setpoint_sequence: m.setpoint_sequence,
            joint_count: m.joint_count as usize,
            q: m.q,
            status: m.status,
        }
    }
}

impl State {
    /// The state as bytes; `None` while a plan runs or waits.
    #[must_use]
    pub fn checkpoint(&self) -> Option<Checkpoint> {
        if self.path.is_some() || !self.queue.is_empty() || self.stop.is_some() {
            return None;
        }
        let watch = &self.watch;
        Some(Checkpoint {
            cycle: self.cycle,
            missed: self.missed,
            sequence: self.sequence,
            scale: self.scale,
            q: self.q,
            v: self.v,
            mode: self.mode.wire(),
            fault: self.fault.wire(),
            has_position: u32::from(self.has_position),
            paused: u32::from(self.paused),
            disabled: u32::from(self.disabled),
            shutdown: u32::from(self.shutdown),
            following: watch.following,
            unheard: watch.unheard,
            has_measured: u32::from(watch.newest.is_some()),
            window_cycles: watch.window_cycles,
            measured: watch.newest.as_ref().map_or_else(MeasuredRecord::zeroed, Into::into),
            fresh_ns: watch.fresh_ns,
            answered: watch.answered,
            refused: watch.refused.count,
            refused_ns: watch.refused.at_ns,
            refused_ahead_ns: watch.refused.ahead_ns,
            window_start_ns: watch.window_start_ns,
            windows: watch.windows,
            rates: watch.rates,
            remembered: self.remembered,
            remembered_v: self.remembered_v,
        })
    }

    /// The state of a checkpoint; `None` where its bytes are no state.
    #[must_use]
    pub fn restore(saved: &Checkpoint) -> Option<Self> {
        let mode = Mode::from_wire(saved.mode)?;
        if matches!(mode, Mode::Executing | Mode::Paused | Mode::Stopping) {
            // There was no plan.
            return None;
        }
        Some(Self {
            mode,
            fault: Fault::from_wire(saved.fault)?,
            cycle: saved.cycle,
            missed: saved.missed,
            sequence: saved.sequence,
            q: saved.q,
            v: saved.v,
            has_position: saved.has_position != 0,
            paused: saved.paused != 0,
            scale: saved.scale,
            disabled: saved.disabled != 0,
            shutdown: saved.shutdown != 0,
            watch: Watch {
                newest: (saved.has_measured != 0).then(|| (&saved.measured).into()),
                fresh_ns: saved.fresh_ns,
                following: saved.following,
                unheard: saved.unheard,
                answered: saved.answered,
                refused: Refused {
                    count: saved.refused,
                    at_ns: saved.refused_ns,
                    ahead_ns: saved.refused_ahead_ns,
                },
                window_start_ns: saved.window_start_ns,
                window_cycles: saved.window_cycles,
                rates: saved.rates,
                windows: saved.windows,
            },
            remembered: saved.remembered,
            remembered_v: saved.remembered_v,
            ..Self::default()
        })
    }
}
