//! Somebody who watches an executor from outside, as an operator's tools do: plan events,
//! telemetry and commands, each wait bounded by a generous time.

use std::time::{Duration, Instant};
use std::{fmt, thread};

use nullsweep_ipc_types::ports::{CommandClient, Ipc, IpcError, PortError, Receiver};
use nullsweep_ipc_types::{
    CommandKind, EventKind, Fault, Mode, PlanEvent, PlanId, Reason, Response, Telemetry,
};

/// How long anything may take on a machine with other work on it.
pub const PATIENCE: Duration = Duration::from_secs(30);
const POLL: Duration = Duration::from_millis(2);

/// The watcher.
#[derive(Debug)]
pub struct Witness {
    events: Receiver<PlanEvent>,
    telemetry: Receiver<Telemetry>,
    commands: CommandClient,
    seen: Vec<PlanEvent>,
    newest: Option<Telemetry>,
}

/// What did not happen in time, or could not be watched.
#[derive(Debug, thiserror::Error)]
pub enum WitnessError {
    /// A port failed.
    #[error(transparent)]
    Ipc(#[from] IpcError),
    /// Reading failed.
    #[error("cannot read from the executor: {0}")]
    Port(#[from] PortError),
    /// It did not happen.
    #[error("{what} did not happen within {seconds} s; {state}")]
    Missed {
        /// What was waited for.
        what: String,
        /// For how long. \[s\]
        seconds: u64,
        /// What was seen instead.
        state: String,
    },
}

impl Witness {
    /// Opens its ports; the executor may start before or after.
    pub fn open(ipc: &Ipc) -> Result<Self, WitnessError> {
        Ok(Self {
            events: ipc.event_receiver()?,
            telemetry: ipc.telemetry_receiver()?,
            commands: ipc.command_client()?,
            seen: Vec::new(),
            newest: None,
        })
    }

    /// Reads everything that has come.
    pub fn look(&mut self) -> Result<(), WitnessError> {
        while let Some(event) = self.events.receive()? {
            self.seen.push(event);
        }
        if let Some(newest) = self.telemetry.newest()? {
            self.newest = Some(newest.value);
        }
        Ok(())
    }

    /// All plan events so far, oldest first.
    #[must_use]
    pub fn events(&self) -> &[PlanEvent] {
        &self.seen
    }

    /// The newest telemetry.
    #[must_use]
    pub fn telemetry(&self) -> Option<&Telemetry> {
        self.newest.as_ref()
    }

    /// Waits for an event of a plan of one of these kinds, whichever is first.
    pub fn event(&mut self, plan: PlanId, kinds: &[EventKind]) -> Result<PlanEvent, WitnessError> {
        let names: Vec<_> = kinds.iter().map(|k| k.text()).collect();
        self.until(format!("plan {plan} {}", names.join(" or ")), |w| {
            w.seen
                .iter()
                .find(|e| e.plan == plan && kinds.iter().any(|k| k.wire() == e.kind))
                .copied()
        })
    }

    /// Waits for the answer to a plan: accepted, or rejected with its reason.
    pub fn admission(&mut self, plan: PlanId) -> Result<PlanEvent, WitnessError> {
        self.event(plan, &[EventKind::Accepted, EventKind::Rejected])
    }

    /// Waits for the one end of an accepted plan.
    pub fn end(&mut self, plan: PlanId) -> Result<PlanEvent, WitnessError> {
        self.event(plan, &[EventKind::Finished, EventKind::Superseded, EventKind::Aborted])
    }

    /// Waits until telemetry reports a mode. An executor that holds takes plans.
    pub fn mode(&mut self, mode: Mode) -> Result<Telemetry, WitnessError> {
        self.see(mode.text(), |t| t.mode == mode.wire())
    }

    /// Waits until telemetry that is newer than this call fits.
    pub fn see(
        &mut self,
        what: &str,
        fits: impl Fn(&Telemetry) -> bool,
    ) -> Result<Telemetry, WitnessError> {
        self.look()?;
        self.newest = None;
        self.until(what.into(), |w| w.newest.filter(|t| fits(t)))
    }

    /// Sends a command.
    pub fn command(&self, kind: CommandKind, value: f64) -> Result<Response, WitnessError> {
        Ok(self.commands.call(kind, value, PATIENCE)?)
    }

    /// Waits until what was seen so far gives an answer.
    pub fn until<T>(
        &mut self,
        what: String,
        mut found: impl FnMut(&Self) -> Option<T>,
    ) -> Result<T, WitnessError> {
        let end = Instant::now() + PATIENCE;
        loop {
            self.look()?;
            if let Some(found) = found(self) {
                return Ok(found);
            }
            if Instant::now() >= end {
                let state = self.to_string();
                return Err(WitnessError::Missed { what, seconds: PATIENCE.as_secs(), state });
            }
            thread::sleep(POLL);
        }
    }
}

impl fmt::Display for Witness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.newest {
            Some(t) => {
                let mode = Mode::from_wire(t.mode).map_or("unknown", Mode::text);
                let fault = Fault::from_wire(t.fault).map_or("unknown", Fault::text);
                write!(f, "the executor is in `{mode}` (fault: {fault})")?;
                write!(f, ", plan {}, knot {}", t.plan, t.knot)?;
            }
            None => write!(f, "no telemetry came")?,
        }
        for event in &self.seen {
            let kind = EventKind::from_wire(event.kind).map_or("unknown", EventKind::text);
            let reason = Reason::from_wire(event.reason).map_or("unknown", Reason::text);
            write!(f, "; plan {} {kind} ({reason})", event.plan)?;
        }
        Ok(())
    }
}
