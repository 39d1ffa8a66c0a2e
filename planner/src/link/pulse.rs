//! Is the executor still there that was told something?

use std::fmt;
use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{Ipc, PortError, Receiver};
use nullsweep_ipc_types::{Mode, PlanId, Telemetry};

/// Silence after which the executor is looked for: it sends telemetry 100 times a second.
const SILENCE: Duration = Duration::from_millis(500);
/// Silence after which an executor that is there counts as lost all the same: it was stopped, or
/// hangs. A machine that is overloaded stalls a process for less.
const HUNG: Duration = Duration::from_secs(10);

/// How the executor was lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loss {
    /// Its process is gone.
    Ended,
    /// Another one is in its place, which knows nothing of what the first one was told.
    Replaced,
    /// Its process is there but says nothing.
    Silent(Duration),
}

/// The executor was lost, and what it told last.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lost {
    /// How.
    pub loss: Loss,
    /// Its last telemetry.
    pub last: Option<Telemetry>,
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.loss {
            Loss::Ended => write!(f, "the executor's process has ended"),
            Loss::Replaced => write!(f, "another executor has taken the executor's place"),
            Loss::Silent(time) => {
                write!(f, "the executor has sent nothing for {:.0} s", time.as_secs_f64())
            }
        }?;
        let Some(last) = &self.last else { return Ok(()) };
        let mode = Mode::from_wire(last.mode).map_or("in an unknown mode", Mode::text);
        write!(f, "; it was last seen in mode {mode}")?;
        if last.plan == PlanId::NONE {
            return write!(f, ", without a plan");
        }
        let seconds = last.plan_time_ns as f64 * 1e-9;
        write!(f, ", plan {} at knot {}, {seconds:.1} s into it", last.plan, last.knot)
    }
}

/// Listens to the executor's telemetry.
pub(super) struct Pulse<'a> {
    ipc: &'a Ipc,
    /// `None` where all places to listen are taken: then nothing is judged.
    telemetry: Option<Receiver<Telemetry>>,
    last: Option<Telemetry>,
    heard: Instant,
    sought: Instant,
}

impl<'a> Pulse<'a> {
    pub(super) fn open(ipc: &'a Ipc) -> Self {
        let now = Instant::now();
        let telemetry = ipc.telemetry_receiver().ok();
        Self { ipc, telemetry, last: None, heard: now, sought: now }
    }

    /// The newest telemetry that was heard.
    pub(super) fn last(&self) -> Option<&Telemetry> {
        self.last.as_ref()
    }

    /// How the executor was lost, if it was. One that was never heard is not judged: it may be
    /// about to start. Call it every few milliseconds.
    pub(super) fn look(&mut self) -> Result<Option<Lost>, PortError> {
        let Some(telemetry) = &self.telemetry else { return Ok(None) };
        while let Some(sample) = telemetry.receive()? {
            let earlier = self.last.replace(sample);
            self.heard = Instant::now();
            if let Some(last) = earlier.filter(|last| sample.sequence < last.sequence) {
                return Ok(Some(Lost { loss: Loss::Replaced, last: Some(last) }));
            }
        }
        let lost = |loss| Ok(Some(Lost { loss, last: self.last }));
        let silence = self.heard.elapsed();
        if self.last.is_none() || silence < SILENCE {
            return Ok(None);
        }
        if self.sought.elapsed() >= SILENCE {
            self.sought = Instant::now();
            // A process that was killed stays in the services' books until somebody sweeps.
            self.ipc.sweep_dead_nodes();
            if telemetry.senders() == 0 {
                return lost(Loss::Ended);
            }
        }
        if silence >= HUNG { lost(Loss::Silent(silence)) } else { Ok(None) }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tempfile::TempDir;

    use super::*;

    fn telemetry(sequence: u64) -> Telemetry {
        Telemetry { sequence, mode: Mode::Hold.wire(), ..Telemetry::zeroed() }
    }

    fn wait(pulse: &mut Pulse<'_>) -> (Lost, Duration) {
        let start = Instant::now();
        loop {
            if let Some(lost) = pulse.look().expect("a port") {
                return (lost, start.elapsed());
            }
            assert!(start.elapsed() < Duration::from_secs(20), "nothing is told");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn an_end_is_told_soon_a_successor_at_once_and_a_late_start_not_at_all() {
        let root = TempDir::new().expect("a folder");
        let ipc = Ipc::open("pr2", Some(root.path())).expect("services");
        let mut pulse = Pulse::open(&ipc);
        std::thread::sleep(2 * SILENCE);
        assert_eq!(pulse.look().expect("a port"), None, "it may be about to start");

        let sender = ipc.telemetry_sender().expect("a port");
        sender.send(&telemetry(7)).expect("sent");
        assert_eq!(pulse.look().expect("a port"), None);
        std::thread::sleep(2 * SILENCE);
        assert_eq!(pulse.look().expect("a port"), None, "it is there, and only slow");
        drop(sender);
        let (lost, after) = wait(&mut pulse);
        assert_eq!(lost.loss, Loss::Ended);
        assert!(after < Duration::from_secs(2), "{after:?}");
        let text = lost.to_string();
        assert_eq!(
            text,
            "the executor's process has ended; it was last seen in mode hold, without a plan"
        );

        let sender = ipc.telemetry_sender().expect("a port");
        sender.send(&telemetry(1)).expect("sent");
        let (lost, _) = wait(&mut pulse);
        assert_eq!((lost.loss, lost.last.map(|t| t.sequence)), (Loss::Replaced, Some(7)));
    }
}
