//! The service thread: events, telemetry, and the desk where commands are answered. It never waits
//! for anything.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, Sender, now_ns};
use nullsweep_ipc_types::{MAX_JOINTS, PlanEvent, Telemetry};

use crate::cycle::{Event, Refused, Snapshot};
use crate::desk::Desk;
use crate::driver::widen;
use crate::journal::{Journal, WARN_EVERY};
use crate::slots::{Report, ServiceEnd};

/// Pause between two rounds.
const ROUND: Duration = Duration::from_micros(500);
/// The same while somebody waits for the loop's answer.
const SHORT_ROUND: Duration = Duration::from_micros(100);
/// How long the last events stay readable after the end: a publisher that exits takes what was
/// not yet read with it.
const LINGER: Duration = Duration::from_millis(200);

/// The ports and what was last told. Make it on the thread that runs it.
#[derive(Debug)]
pub(crate) struct Service {
    slots: ServiceEnd,
    desk: Desk,
    telemetry: Sender<Telemetry>,
    events: Sender<PlanEvent>,
    joint_count: usize,
    told: u64,
    snapshots: u64,
    newest: Option<Snapshot>,
    journal: Journal,
    lost_lines: Arc<AtomicU64>,
    /// Joint states refused for their stamps that were warned of, and when.
    refused: (u64, Option<Instant>),
}

impl Service {
    pub(crate) fn open(
        ipc: &Ipc,
        slots: ServiceEnd,
        joint_count: usize,
        journal: Journal,
        lost_lines: Arc<AtomicU64>,
    ) -> Result<Self, IpcError> {
        Ok(Self {
            slots,
            desk: Desk::new(ipc.command_server()?),
            telemetry: ipc.telemetry_sender()?,
            events: ipc.event_sender()?,
            joint_count,
            told: 0,
            snapshots: 0,
            newest: None,
            journal,
            lost_lines,
            refused: (0, None),
        })
    }

    /// Runs until `done`, then tells what is left.
    pub(crate) fn run(mut self, done: &AtomicBool) {
        while !done.load(Ordering::Acquire) {
            self.round();
            thread::sleep(if self.desk.is_waiting() { SHORT_ROUND } else { ROUND });
        }
        let end = Instant::now() + LINGER;
        while Instant::now() < end {
            self.round();
            thread::sleep(ROUND);
        }
    }

    fn round(&mut self) {
        for from in &mut self.slots.events {
            while let Ok(event) = from.pop() {
                self.told += 1;
                if let Err(e) = self.events.send(&on_wire(&event, self.told)) {
                    tracing::error!("plan event lost: {e}");
                }
                self.journal.event(&event);
            }
        }
        // Late listeners get the history also while nothing new happens.
        let _ = self.events.connect();
        while let Ok(report) = self.slots.reports.pop() {
            self.snapshots += 1;
            self.newest = Some(report.snapshot);
            self.journal.report(&report.snapshot);
            self.warn_of_refused(&report.snapshot.refused);
            let telemetry = self.telemetry_of(&report);
            if let Err(e) = self.telemetry.send(&telemetry) {
                tracing::warn!("telemetry lost: {e}");
            }
        }
        if let Err(e) = self.desk.round(&mut self.slots, self.newest) {
            tracing::warn!("commands cannot be received: {e}");
        }
    }

    /// Without it, an endpoint with another clock is only one that is silent.
    fn warn_of_refused(&mut self, refused: &Refused) {
        let (told, at) = self.refused;
        if refused.count > told && at.is_none_or(|at| at.elapsed() >= WARN_EVERY) {
            tracing::warn!("{}", refusal(refused, refused.count - told));
            self.refused = (refused.count, Some(Instant::now()));
        }
    }

    fn telemetry_of(&self, report: &Report) -> Telemetry {
        let snapshot = &report.snapshot;
        Telemetry {
            sequence: self.snapshots,
            stamp_ns: report.stamp_ns,
            cycle: snapshot.cycle,
            missed_cycles: snapshot.missed,
            lost_lines: self.lost_lines.load(Ordering::Relaxed),
            plan: snapshot.plan,
            plan_time_ns: snapshot.plan_time_ns,
            speed_scale: snapshot.rate,
            commanded: widen(&snapshot.commanded),
            measured: widen(&snapshot.measured),
            lateness: report.lateness,
            compute: report.compute,
            round_trip: report.round_trip,
            joint_count: self.joint_count.min(MAX_JOINTS) as u32,
            mode: snapshot.mode.wire(),
            fault: snapshot.fault.wire(),
            knot: snapshot.stopped.unwrap_or(snapshot.knot),
            unverified: u32::from(snapshot.unverified),
            stopped: u32::from(snapshot.stopped.is_some()),
            held_count: report.held.count as u32,
            reserved: 0,
            held_positions: report.held.positions,
        }
    }
}

/// What was refused, and which clock it may be.
fn refusal(refused: &Refused, new: u64) -> String {
    let seconds = refused.ahead_ns.unsigned_abs() as f64 * 1e-9;
    let side = if refused.ahead_ns > 0 { "ahead of" } else { "behind" };
    // No machine has been on for as long as it is since 1970.
    let epoch = if seconds > 1e9 { ", as CLOCK_REALTIME is" } else { "" };
    format!(
        "{new} joint states refused: the last one's stamp is {seconds:.3} s {side} \
         CLOCK_MONOTONIC{epoch}; the endpoint must stamp by CLOCK_MONOTONIC"
    )
}

fn on_wire(event: &Event, sequence: u64) -> PlanEvent {
    PlanEvent {
        sequence,
        stamp_ns: now_ns(),
        plan: event.plan,
        value: event.why.value,
        bound: event.why.bound,
        kind: event.kind.wire(),
        reason: event.why.reason.wire(),
        joint: event.why.joint,
        knot: event.why.knot,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refused_stamp_is_told_with_its_clock() {
        let told = |ahead_ns| refusal(&Refused { count: 9, at_ns: 1, ahead_ns }, 3);
        let hour = told(3_600_000_000_000);
        assert!(hour.starts_with("3 joint states refused") && hour.contains("3600.000 s ahead of"));
        assert!(!hour.contains("REALTIME"), "{hour}");
        assert!(told(1_764_000_000_000_000_000).contains("as CLOCK_REALTIME is"));
        assert!(told(-2_000_000_000).contains("2.000 s behind CLOCK_MONOTONIC"));
    }
}
