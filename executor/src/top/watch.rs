//! The ports of a screen: they come and go with the executor. An answer is waited for 300 ms; opening
//! them may take seconds, where something of iceoryx2's is damaged.

use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{CommandClient, Ipc, IpcError, PortError, Receiver};
use nullsweep_ipc_types::{CommandKind, PlanEvent, Response, Telemetry, Verdict};

use super::board::Board;
use crate::pidfile::Running;
use crate::system::SystemArgs;

/// How long an answer is waited for.
const ANSWER_WITHIN: Duration = Duration::from_millis(300);
/// Pause before the ports are opened again.
const AGAIN: Duration = Duration::from_secs(1);

/// The ports, while they can be had.
#[derive(Debug)]
pub(super) struct Watch {
    system: SystemArgs,
    ports: Option<Ports>,
    tried: Option<Instant>,
}

#[derive(Debug)]
struct Ports {
    telemetry: Receiver<Telemetry>,
    events: Receiver<PlanEvent>,
    /// Made for the first command: there may be only four at a time.
    commands: Option<CommandClient>,
    ipc: Ipc,
}

impl Watch {
    pub(super) fn new(system: &SystemArgs) -> Self {
        Self { system: system.clone(), ports: None, tried: None }
    }

    /// Takes in all that has come, and opens the ports where they are not.
    pub(super) fn look(&mut self, board: &mut Board, now: Instant) {
        if self.ports.is_none() && self.tried.is_none_or(|at| at + AGAIN <= now) {
            self.tried = Some(now);
            match Ports::open(&self.system) {
                Ok(ports) => self.ports = Some(ports),
                Err(error) => board.trouble = Some(error.to_string()),
            }
        }
        if let Some(ports) = &self.ports
            && let Err(error) = ports.read(board, now)
        {
            board.trouble = Some(error.to_string());
            self.ports = None;
        }
        board.look(now);
    }

    /// Sends a command and tells the board how it was taken; the speed scale that is asked for
    /// from then on.
    pub(super) fn command(
        &mut self,
        kind: CommandKind,
        value: f64,
        board: &mut Board,
    ) -> Option<f64> {
        // A stop goes past shared memory first, as that of `executor ctl` does.
        let signalled = match kind {
            CommandKind::Stop => Running::stopped(&self.system, false),
            CommandKind::StopAndDisable => Running::stopped(&self.system, true),
            _ => None,
        };
        let answer = match &mut self.ports {
            Some(ports) => ports.command(kind, value).map_err(|error| error.to_string()),
            None => Err("there is no executor".into()),
        };
        let answer = answer.map_err(|error| match &signalled {
            Some(running) => format!(
                "sent to process {} as a signal; how it was taken is not known: {error}",
                running.pid
            ),
            None => error,
        });
        let verdict =
            |r: &Response| Verdict::from_wire(r.verdict).map_or("unknown answer", Verdict::text);
        board.answer = match &answer {
            Ok(response) if kind == CommandKind::Speed => {
                format!("{kind:?} {:.0} %: {}", 100.0 * response.speed_scale, verdict(response))
            }
            Ok(response) => format!("{kind:?}: {}", verdict(response)),
            Err(error) => format!("{kind:?}: {error}"),
        };
        answer.ok().map(|response| response.speed_scale)
    }
}

impl Ports {
    fn open(system: &SystemArgs) -> Result<Self, IpcError> {
        let ipc = Ipc::open(&system.robot_name, system.ipc_root.as_deref())?;
        let (telemetry, events) = (ipc.telemetry_receiver()?, ipc.event_receiver()?);
        Ok(Self { telemetry, events, commands: None, ipc })
    }

    fn read(&self, board: &mut Board, now: Instant) -> Result<(), PortError> {
        while let Some(event) = self.events.receive()? {
            board.event(&event);
        }
        if let Some(newest) = self.telemetry.newest()? {
            board.hear(newest.value, now);
        }
        Ok(())
    }

    fn command(&mut self, kind: CommandKind, value: f64) -> Result<Response, IpcError> {
        let client = match self.commands.take() {
            Some(client) => client,
            None => self.ipc.command_client()?,
        };
        let answer = client.call(kind, value, ANSWER_WITHIN)?;
        // Kept only where it has been answered: another executor is another server.
        self.commands = Some(client);
        Ok(answer)
    }
}
