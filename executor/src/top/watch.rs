//! The ports of a screen: they come and go with the executor, and nothing here waits for it.

use std::time::{Duration, Instant};

use nullsweep_ipc_types::ports::{CommandClient, Ipc, IpcError, PortError, Receiver};
use nullsweep_ipc_types::{CommandKind, PlanEvent, Telemetry, Verdict};

use super::board::Board;
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

    /// Sends a command and tells the board how it was taken.
    pub(super) fn command(&mut self, kind: CommandKind, value: f64, board: &mut Board) {
        let Some(ports) = &mut self.ports else {
            board.answer = format!("{kind:?}: there is no executor");
            return;
        };
        board.answer = match ports.command(kind, value) {
            Ok(verdict) => format!("{kind:?}: {verdict}"),
            Err(error) => format!("{kind:?}: {error}"),
        };
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

    fn command(&mut self, kind: CommandKind, value: f64) -> Result<&'static str, IpcError> {
        let client = match self.commands.take() {
            Some(client) => client,
            None => self.ipc.command_client()?,
        };
        let answer = client.call(kind, value, ANSWER_WITHIN)?;
        // Kept only where it has been answered: another executor is another server.
        self.commands = Some(client);
        Ok(Verdict::from_wire(answer.verdict).map_or("unknown answer", Verdict::text))
    }
}
