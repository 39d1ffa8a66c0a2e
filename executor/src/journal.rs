//! The service thread's log: one line for whatever an operator would ask about.

use std::time::{Duration, Instant};

use nullsweep_ipc_types::{Command, CommandKind, EventKind, Fault, Mode, PlanId, Reason, Response};

use crate::cycle::{Event, Snapshot};
use crate::words::{self, Words};

/// A start and a reset pass through [`Mode::Init`] in less.
const WAITS: Duration = Duration::from_millis(500);
/// Least time between two warnings of missed deadlines.
pub(crate) const WARN_EVERY: Duration = Duration::from_secs(10);

/// What was last told.
#[derive(Debug)]
pub(crate) struct Journal {
    words: Words,
    mode: Mode,
    fault: Fault,
    /// The plan that was last warned of.
    unverified: PlanId,
    /// Since when the loop waits in [`Mode::Init`], and for what was told to be waited.
    init: Instant,
    waits_for: Option<Fault>,
    /// Missed deadlines that were warned of, and when.
    missed: (u64, Option<Instant>),
}

impl Journal {
    pub(crate) fn new(words: Words) -> Self {
        Self {
            words,
            mode: Mode::Init,
            fault: Fault::None,
            unverified: PlanId::NONE,
            init: Instant::now(),
            waits_for: None,
            missed: (0, None),
        }
    }

    /// What became of a plan.
    pub(crate) fn event(&self, event: &Event) {
        let text = self.words.event(event);
        let wanted = matches!(event.why.reason, Reason::None | Reason::Stopped | Reason::Shutdown);
        if wanted && event.kind != EventKind::Rejected {
            tracing::info!("{text}");
        } else {
            tracing::warn!("{text}");
        }
    }

    /// A command and its answer. Questions for the status are many, and change nothing.
    pub(crate) fn command(command: &Command, response: &Response) {
        if command.kind == CommandKind::Status.wire() {
            tracing::debug!("{}", words::command(command, response));
        } else {
            tracing::info!("{}", words::command(command, response));
        }
    }

    /// A signal has had the arm stop.
    pub(crate) fn signal(now: &Snapshot) {
        tracing::info!("stopped by a signal: mode {}", now.mode);
    }

    /// What the loop is doing.
    pub(crate) fn report(&mut self, now: &Snapshot) {
        let (mode, fault) = (self.mode, self.fault);
        (self.mode, self.fault) = (now.mode, now.fault);
        let changed = (mode, fault) != (now.mode, now.fault);
        match now.mode {
            Mode::Fault if changed => tracing::error!("fault: {}", self.words.fault(now)),
            Mode::Init => self.wait(mode, now),
            Mode::Hold if matches!(mode, Mode::Init | Mode::Fault) => {
                tracing::info!("holding the arm: plans and commands are taken");
            }
            _ => {}
        }
        // The arm was stopped on its path, and may hold again by now.
        let lapse = matches!(now.fault, Fault::StaleState | Fault::HeldJoint);
        if lapse && fault != now.fault && matches!(now.mode, Mode::Stopping | Mode::Hold) {
            tracing::warn!("stopped on the path: {}", self.words.fault(now));
        }
        if now.unverified && self.unverified != now.plan {
            self.unverified = now.plan;
            tracing::warn!(
                "plan {} is executed and NOT VERIFIED: its sender does not say that the planner's \
                 check passed it",
                now.plan
            );
        }
        self.warn_of_missed(now.missed);
    }

    /// Tells once for what the loop waits.
    fn wait(&mut self, before: Mode, now: &Snapshot) {
        if before != Mode::Init {
            if before == Mode::Fault {
                tracing::info!("the fault is cleared");
            }
            self.init = Instant::now();
            self.waits_for = None;
        }
        if self.init.elapsed() >= WAITS && self.waits_for != Some(now.fault) {
            self.waits_for = Some(now.fault);
            tracing::warn!("{}", self.words.waiting(now));
        }
    }

    /// Plans run later by each missed deadline: whoever watches shall know.
    fn warn_of_missed(&mut self, missed: u64) {
        let (told, at) = self.missed;
        if missed > told && at.is_none_or(|at| at.elapsed() >= WARN_EVERY) {
            tracing::warn!("{} deadlines missed, {missed} since the start", missed - told);
            self.missed = (missed, Some(Instant::now()));
        }
    }
}
