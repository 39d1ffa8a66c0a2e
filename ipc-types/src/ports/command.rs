//! Commands: a question to the executor and its answer.

use std::path::{Path, PathBuf};
use std::string::String;
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{BackpressureStrategy, PortFactory as _, ipc};
use iceoryx2::service::port_factory::request_response::PortFactory;

use super::error::{IpcError, PortError};
use super::node::Ipc;
use crate::service::{COMMAND, COMMAND_CLIENTS, COMMAND_REQUESTS, MAX_NODES};
use crate::{Command, CommandKind, Response};

type Service = PortFactory<ipc::Service, Command, (), Response, ()>;

/// How often a client looks for its answer.
const POLL: Duration = Duration::from_micros(100);

/// An operator's end of the command service.
#[derive(Debug)]
pub struct CommandClient {
    client: Client<ipc::Service, Command, (), Response, ()>,
    service: Service,
    robot: String,
    root: Option<PathBuf>,
}

impl CommandClient {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        let service = open(ipc)?;
        let client = ipc.retry(COMMAND, || {
            service
                .client_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        })?;
        Ok(Self {
            client,
            service,
            robot: ipc.robot().into(),
            root: ipc.root().map(Path::to_path_buf),
        })
    }

    /// Asks and waits for the answer, at most `timeout`. `value` is the argument of
    /// [`CommandKind::Speed`], else 0.
    pub fn call(
        &self,
        kind: CommandKind,
        value: f64,
        timeout: Duration,
    ) -> Result<Response, IpcError> {
        let asked = self.ask(kind, value)?;
        let start = Instant::now();
        loop {
            if let Some(response) = asked.answer()? {
                return Ok(response);
            }
            if start.elapsed() >= timeout {
                return Err(IpcError::NoAnswer {
                    robot: self.robot.clone(),
                    millis: timeout.as_millis(),
                });
            }
            thread::sleep(POLL);
        }
    }

    /// Asks and does not wait. A client may have [`COMMAND_REQUESTS`] questions open.
    pub fn ask(&self, kind: CommandKind, value: f64) -> Result<Asked, IpcError> {
        let absent = || IpcError::NoExecutor { robot: self.robot.clone(), root: self.root.clone() };
        if self.service.dynamic_config().number_of_servers() == 0 {
            return Err(absent());
        }
        let command = Command { value, kind: kind.wire(), reserved: 0 };
        let pending = self.client.send_copy(command).map_err(|_| port(PortError::Connection))?;
        if pending.number_of_server_connections() == 0 {
            return Err(absent());
        }
        Ok(Asked(pending))
    }
}

/// A question whose answer may come.
#[derive(Debug)]
pub struct Asked(PendingResponse<ipc::Service, Command, (), Response, ()>);

impl Asked {
    /// The answer, if it has come.
    pub fn answer(&self) -> Result<Option<Response>, IpcError> {
        Ok(self.0.receive().map_err(|e| port(e.into()))?.map(|response| *response))
    }
}

fn port(error: PortError) -> IpcError {
    IpcError::Port { what: COMMAND, error }
}

/// The executor's end of the command service.
#[derive(Debug)]
pub struct CommandServer {
    server: Server<ipc::Service, Command, (), Response, ()>,
    // Held so that the service outlives its clients.
    _service: Service,
}

impl CommandServer {
    pub(super) fn open(ipc: &Ipc) -> Result<Self, IpcError> {
        let service = open(ipc)?;
        let server = ipc.retry(COMMAND, || {
            service
                .server_builder()
                .backpressure_strategy(BackpressureStrategy::DiscardData)
                .create()
        })?;
        Ok(Self { server, _service: service })
    }

    /// The next request that waits. Until it is answered or dropped it counts as one of its
    /// client's [`COMMAND_REQUESTS`].
    pub fn receive(&self) -> Result<Option<Request>, PortError> {
        Ok(self.server.receive()?.map(Request))
    }
}

/// A command that waits for its answer.
#[derive(Debug)]
pub struct Request(ActiveRequest<ipc::Service, Command, (), Response, ()>);

impl Request {
    /// What is asked.
    #[must_use]
    pub fn command(&self) -> Command {
        *self.0.payload()
    }

    /// Answers it. A client that is gone by then gets nothing.
    pub fn answer(self, response: Response) -> Result<(), PortError> {
        Ok(self.0.send_copy(response)?)
    }
}

fn open(ipc: &Ipc) -> Result<Service, IpcError> {
    let name = ipc.service_name(COMMAND)?;
    ipc.retry(COMMAND, || {
        ipc.node
            .service_builder(&name)
            .request_response::<Command, Response>()
            .max_clients(COMMAND_CLIENTS)
            .max_servers(1)
            .max_nodes(MAX_NODES)
            .max_active_requests_per_client(COMMAND_REQUESTS)
            .max_response_buffer_size(2)
            .enable_safe_overflow_for_requests(false)
            .enable_safe_overflow_for_responses(true)
            .enable_fire_and_forget_requests(false)
            .open_or_create()
    })
}
