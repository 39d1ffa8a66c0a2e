//! Questions and answers: one who answers, several who ask.

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::string::String;
use std::thread;
use std::time::{Duration, Instant};

use bytemuck::Pod;
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{BackpressureStrategy, PortFactory as _, ipc};
use iceoryx2::service::port_factory::request_response::PortFactory;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

use super::error::{IpcError, PortError};
use super::node::Ipc;
use crate::service::MAX_NODES;
use crate::{BaseCommand, BaseStatus, Command, Response};

/// A fixed-size question or answer.
pub(super) trait Message: Pod + ZeroCopySend + Debug {}
impl Message for Command {}
impl Message for Response {}
impl Message for BaseCommand {}
impl Message for BaseStatus {}

/// A service of questions and answers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Terms {
    /// Last part of its name.
    pub(super) name: &'static str,
    /// Most who ask.
    pub(super) clients: usize,
    /// Questions that one of them may have open.
    pub(super) requests: usize,
    /// What is wrong where nobody of this robot answers under this root path.
    pub(super) absent: fn(String, Option<PathBuf>) -> IpcError,
    /// What is wrong where no answer came within so many ms.
    pub(super) mute: fn(String, u128) -> IpcError,
}

/// How often a client looks for its answer.
const POLL: Duration = Duration::from_micros(100);

type Service<Q, A> = PortFactory<ipc::Service, Q, (), A, ()>;

/// The end of whoever asks.
#[derive(Debug)]
pub(super) struct Asker<Q: Message, A: Message> {
    client: Client<ipc::Service, Q, (), A, ()>,
    service: Service<Q, A>,
    robot: String,
    root: Option<PathBuf>,
    terms: Terms,
}

impl<Q: Message, A: Message> Asker<Q, A> {
    pub(super) fn open(ipc: &Ipc, terms: Terms) -> Result<Self, IpcError> {
        let service = open(ipc, terms)?;
        let client = ipc.retry(terms.name, || {
            service
                .client_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        })?;
        let (robot, root) = (ipc.robot().into(), ipc.root().map(Path::to_path_buf));
        Ok(Self { client, service, robot, root, terms })
    }

    /// Whether somebody answers.
    pub(super) fn is_answered(&self) -> bool {
        self.service.dynamic_config().number_of_servers() > 0
    }

    /// Asks and waits for the answer, at most `timeout`.
    pub(super) fn call(&self, question: Q, timeout: Duration) -> Result<A, IpcError> {
        let asked = self.ask(question)?;
        let start = Instant::now();
        loop {
            if let Some(answer) = asked.answer()? {
                return Ok(answer);
            }
            if start.elapsed() >= timeout {
                return Err((self.terms.mute)(self.robot.clone(), timeout.as_millis()));
            }
            thread::sleep(POLL);
        }
    }

    /// Asks and does not wait.
    pub(super) fn ask(&self, question: Q) -> Result<Open<Q, A>, IpcError> {
        let what = self.terms.name;
        let absent = || (self.terms.absent)(self.robot.clone(), self.root.clone());
        if !self.is_answered() {
            return Err(absent());
        }
        let sent = self.client.send_copy(question);
        let pending = sent.map_err(|_| IpcError::Port { what, error: PortError::Connection })?;
        if pending.number_of_server_connections() == 0 {
            return Err(absent());
        }
        Ok(Open { pending, what })
    }
}

/// A question whose answer may come.
#[derive(Debug)]
pub(super) struct Open<Q: Message, A: Message> {
    pending: PendingResponse<ipc::Service, Q, (), A, ()>,
    what: &'static str,
}

impl<Q: Message, A: Message> Open<Q, A> {
    /// The answer, if it has come.
    pub(super) fn answer(&self) -> Result<Option<A>, IpcError> {
        let answer = self.pending.receive();
        let answer = answer.map_err(|e| IpcError::Port { what: self.what, error: e.into() })?;
        Ok(answer.map(|answer| *answer))
    }
}

/// The end of the one who answers.
#[derive(Debug)]
pub(super) struct Answerer<Q: Message, A: Message> {
    server: Server<ipc::Service, Q, (), A, ()>,
    // Held so that the service outlives its clients.
    _service: Service<Q, A>,
}

impl<Q: Message, A: Message> Answerer<Q, A> {
    pub(super) fn open(ipc: &Ipc, terms: Terms) -> Result<Self, IpcError> {
        let service = open(ipc, terms)?;
        let server = ipc.retry(terms.name, || {
            service
                .server_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        })?;
        Ok(Self { server, _service: service })
    }

    /// The next question that waits.
    pub(super) fn receive(&self) -> Result<Option<Question<Q, A>>, PortError> {
        Ok(self.server.receive()?.map(Question))
    }
}

/// A question that waits for its answer.
#[derive(Debug)]
pub(super) struct Question<Q: Message, A: Message>(ActiveRequest<ipc::Service, Q, (), A, ()>);

impl<Q: Message, A: Message> Question<Q, A> {
    /// What is asked.
    pub(super) fn question(&self) -> Q {
        *self.0.payload()
    }

    /// Answers it. A client that is gone by then gets nothing.
    pub(super) fn answer(self, answer: A) -> Result<(), PortError> {
        Ok(self.0.send_copy(answer)?)
    }
}

fn open<Q: Message, A: Message>(ipc: &Ipc, terms: Terms) -> Result<Service<Q, A>, IpcError> {
    let name = ipc.service_name(terms.name)?;
    ipc.retry(terms.name, || {
        ipc.node
            .service_builder(&name)
            .request_response::<Q, A>()
            .max_clients(terms.clients)
            .max_servers(1)
            .max_nodes(MAX_NODES)
            .max_active_requests_per_client(terms.requests)
            .max_response_buffer_size(2)
            .enable_safe_overflow_for_requests(false)
            .enable_safe_overflow_for_responses(true)
            .enable_fire_and_forget_requests(false)
            .open_or_create()
    })
}
