//! Where the robot's base is to be: a question to whatever moves it, and its answer.

use std::time::Duration;

use super::error::{IpcError, PortError};
use super::inquiry::{Answerer, Asker, Question, Terms};
use super::node::Ipc;
use crate::service::{BASE, BASE_CLIENTS, BASE_REQUESTS};
use crate::{BaseCommand, BaseStatus};

const TERMS: Terms = Terms {
    name: BASE,
    clients: BASE_CLIENTS,
    requests: BASE_REQUESTS,
    absent: |robot, root| IpcError::NoBase { robot, root },
    mute: |robot, millis| IpcError::MuteBase { robot, millis },
};

/// A program's, or an operator's, end of the base service.
#[derive(Debug)]
pub struct BaseClient(Asker<BaseCommand, BaseStatus>);

impl BaseClient {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        Asker::open(ipc, TERMS).map(Self)
    }

    /// Whether something answers that moves the base, or somebody for it.
    #[must_use]
    pub fn is_answered(&self) -> bool {
        self.0.is_answered()
    }

    /// Asks and waits for the answer, at most `timeout`: it says how the order was taken, not how it
    /// ended.
    pub fn call(&self, command: BaseCommand, timeout: Duration) -> Result<BaseStatus, IpcError> {
        self.0.call(command, timeout)
    }
}

/// The end of what moves the base. There is one.
#[derive(Debug)]
pub struct BaseServer(Answerer<BaseCommand, BaseStatus>);

impl BaseServer {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        Answerer::open(ipc, TERMS).map(Self)
    }

    /// The next order that waits.
    pub fn receive(&self) -> Result<Option<BaseRequest>, PortError> {
        Ok(self.0.receive()?.map(BaseRequest))
    }
}

/// An order that waits for its answer.
#[derive(Debug)]
pub struct BaseRequest(Question<BaseCommand, BaseStatus>);

impl BaseRequest {
    /// What is asked.
    #[must_use]
    pub fn command(&self) -> BaseCommand {
        self.0.question()
    }

    /// Answers it. A client that is gone by then gets nothing.
    pub fn answer(self, status: BaseStatus) -> Result<(), PortError> {
        self.0.answer(status)
    }
}
