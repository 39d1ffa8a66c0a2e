//! The worker thread: takes plans out of shared memory, admits them, frees old ones, sweeps up
//! after processes that died. Nothing here is urgent enough to disturb the other two.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, IpcError, PlanReceiver, now_ns};
use nullsweep_ipc_types::{EventKind, Knot, MAX_KNOTS, Reason};
use rtrb::PushError;

use crate::admit::{Held, Rejection, Rules, admit};
use crate::cycle::Event;
use crate::ids::Ids;
use crate::record::Recorder;
use crate::slots::{HELD_ROOM, WorkerEnd};

/// Pause between two looks.
const ROUND: Duration = Duration::from_millis(1);
/// How long a plan is left where it is while it is not known where the held joints stand; they are
/// told 100 times a second.
const HELD_WITHIN: Duration = Duration::from_millis(100);
/// Pause between two sweeps for dead processes.
const SWEEP: Duration = Duration::from_secs(1);

/// The plan port and the memory for private copies. Make it on the thread that runs it.
#[derive(Debug)]
pub(crate) struct Worker<'a> {
    ipc: &'a Ipc,
    receiver: PlanReceiver,
    slots: WorkerEnd,
    rules: Rules,
    copy: Vec<Knot>,
    held: Option<Held>,
    /// Since when it is not known where the held joints stand.
    unknown: Instant,
    ids: Ids,
    recorder: Option<Recorder>,
}

impl<'a> Worker<'a> {
    pub(crate) fn open(
        ipc: &'a Ipc,
        slots: WorkerEnd,
        rules: Rules,
        recorder: Option<Recorder>,
    ) -> Result<Self, IpcError> {
        let receiver = ipc.plan_receiver()?;
        let copy = Vec::with_capacity(MAX_KNOTS);
        let (held, unknown, ids) = (None, Instant::now(), Ids::default());
        Ok(Self { ipc, receiver, slots, rules, copy, held, unknown, ids, recorder })
    }

    /// Runs until `done`.
    pub(crate) fn run(mut self, done: &AtomicBool) {
        let mut swept = Instant::now();
        while !done.load(Ordering::Acquire) {
            while let Ok(plan) = self.slots.retired.pop() {
                drop(plan);
            }
            self.take_held();
            if self.held.is_some() || self.unknown.elapsed() >= HELD_WITHIN {
                self.take_plan();
            }
            self.write_record(Recorder::round);
            if swept.elapsed() >= SWEEP {
                let count = self.ipc.sweep_dead_nodes();
                if count > 0 {
                    tracing::info!("swept up after {count} dead processes");
                }
                swept = Instant::now();
            }
            thread::sleep(ROUND);
        }
        self.write_record(Recorder::round);
        self.write_record(Recorder::finish);
    }

    /// Writes to the flight recorder; where that fails, the executor runs on without it.
    fn write_record(&mut self, write: fn(&mut Recorder) -> std::io::Result<()>) {
        if let Some(recorder) = &mut self.recorder
            && let Err(e) = write(recorder)
        {
            tracing::error!("the flight recorder stops: {e}");
            self.recorder = None;
        }
    }

    /// Takes the newest held joints. Where their queue was full this thread was put aside for long,
    /// and what it finds there is old: then newer ones are waited for.
    fn take_held(&mut self) {
        let missed = self.slots.held.slots() >= HELD_ROOM;
        while let Ok(held) = self.slots.held.pop() {
            self.held = Some(held);
        }
        if missed {
            (self.held, self.unknown) = (None, Instant::now());
        }
    }

    /// Takes at most one plan out of shared memory.
    fn take_plan(&mut self) {
        let plan = match self.receiver.receive() {
            Ok(Some(plan)) => plan,
            Ok(None) => return,
            Err(e) => {
                tracing::warn!("plans cannot be received: {e}");
                return;
            }
        };
        // The publisher can still write to what it sent: only the copy is looked at.
        let header = *plan.header();
        self.copy.clear();
        self.copy.extend_from_slice(&plan.knots()[..plan.knots().len().min(MAX_KNOTS)]);
        drop(plan);

        let start = Instant::now();
        let admitted = admit(&header, &self.copy, self.held.as_ref(), &self.rules, now_ns());
        let checked = start.elapsed();
        let result = self.ids.judge(header.id, admitted).and_then(|plan| {
            let (knots, seconds) = (plan.knots().len(), plan.duration() * 1e-9);
            let plan = Arc::new(plan.checked(now_ns()));
            if let Some(recorder) = &mut self.recorder {
                recorder.plan(&plan);
            }
            self.slots.offers.push(plan).map_err(|PushError::Full(plan)| {
                if let Some(recorder) = &mut self.recorder {
                    recorder.withdraw(&plan);
                }
                Rejection::new(Reason::QueueFull)
            })?;
            // Only now, as writing it takes longer than the loop takes to begin with the plan.
            tracing::info!(
                "plan {} received: {knots} knots, {seconds:.1} s, sound by itself ({:.2} ms); \
                 whether it fits the moment is told next",
                header.id,
                checked.as_secs_f64() * 1e3,
            );
            Ok(())
        });
        if let Err(why) = result {
            // The service thread tells it, with the joints' names.
            let event = Event { plan: header.id, kind: EventKind::Rejected, why };
            if self.slots.events.push(event).is_err() {
                tracing::error!("plan {} rejected: {why}; its publisher is not told", header.id);
            }
        }
    }
}
