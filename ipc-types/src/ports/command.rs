//! Commands: a question to the executor and its answer.

use std::time::Duration;

use super::error::{IpcError, PortError};
use super::inquiry::{Answerer, Asker, Open, Question, Terms};
use super::node::Ipc;
use crate::service::{COMMAND, COMMAND_CLIENTS, COMMAND_REQUESTS};
use crate::{Command, CommandKind, Response};

const TERMS: Terms = Terms {
    name: COMMAND,
    clients: COMMAND_CLIENTS,
    requests: COMMAND_REQUESTS,
    absent: |robot, root| IpcError::NoExecutor { robot, root },
    mute: |robot, millis| IpcError::NoAnswer { robot, millis },
};

/// An operator's end of the command service.
#[derive(Debug)]
pub struct CommandClient(Asker<Command, Response>);

impl CommandClient {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        Asker::open(ipc, TERMS).map(Self)
    }

    /// Asks and waits for the answer, at most `timeout`. `value` is the argument of
    /// [`CommandKind::Speed`], else 0.
    pub fn call(
        &self,
        kind: CommandKind,
        value: f64,
        timeout: Duration,
    ) -> Result<Response, IpcError> {
        self.0.call(command(kind, value), timeout)
    }

    /// Asks and does not wait. A client may have [`COMMAND_REQUESTS`] questions open.
    pub fn ask(&self, kind: CommandKind, value: f64) -> Result<Asked, IpcError> {
        self.0.ask(command(kind, value)).map(Asked)
    }
}

fn command(kind: CommandKind, value: f64) -> Command {
    Command { value, kind: kind.wire(), reserved: 0 }
}

/// A question whose answer may come.
#[derive(Debug)]
pub struct Asked(Open<Command, Response>);

impl Asked {
    /// The answer, if it has come.
    pub fn answer(&self) -> Result<Option<Response>, IpcError> {
        self.0.answer()
    }
}

/// The executor's end of the command service.
#[derive(Debug)]
pub struct CommandServer(Answerer<Command, Response>);

impl CommandServer {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        Answerer::open(ipc, TERMS).map(Self)
    }

    /// The next request that waits. Until it is answered or dropped it counts as one of its
    /// client's [`COMMAND_REQUESTS`].
    pub fn receive(&self) -> Result<Option<Request>, PortError> {
        Ok(self.0.receive()?.map(Request))
    }
}

/// A command that waits for its answer.
#[derive(Debug)]
pub struct Request(Question<Command, Response>);

impl Request {
    /// What is asked.
    #[must_use]
    pub fn command(&self) -> Command {
        self.0.question()
    }

    /// Answers it. A client that is gone by then gets nothing.
    pub fn answer(self, response: Response) -> Result<(), PortError> {
        self.0.answer(response)
    }
}
