//! Commands: a question to the executor and its answer.

use std::string::String;
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{BackpressureStrategy, PortFactory as _, ipc};
use iceoryx2::service::port_factory::request_response::PortFactory;

use super::error::{IpcError, PortError};
use super::node::Ipc;
use crate::service::{COMMAND, COMMAND_CLIENTS, MAX_NODES};
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
        Ok(Self { client, service, robot: ipc.robot().into() })
    }

    /// Asks and waits for the answer, at most `timeout`. `value` is the argument of
    /// [`CommandKind::Speed`], else 0.
    pub fn call(
        &self,
        kind: CommandKind,
        value: f64,
        timeout: Duration,
    ) -> Result<Response, IpcError> {
        let absent = || IpcError::NoExecutor { robot: self.robot.clone() };
        let port = |error: PortError| IpcError::Port { what: COMMAND, error };
        if self.service.dynamic_config().number_of_servers() == 0 {
            return Err(absent());
        }
        let command = Command { value, kind: kind.wire(), reserved: 0 };
        let pending = self.client.send_copy(command).map_err(|_| port(PortError::Connection))?;
        if pending.number_of_server_connections() == 0 {
            return Err(absent());
        }
        let start = Instant::now();
        loop {
            if let Some(response) = pending.receive().map_err(|e| port(e.into()))? {
                return Ok(*response);
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

    /// Answers every command that waits; how many. A client that is gone by then gets nothing.
    pub fn answer(&self, mut answer: impl FnMut(&Command) -> Response) -> Result<usize, PortError> {
        let mut answered = 0;
        while let Some(request) = self.server.receive()? {
            let response = answer(request.payload());
            request.send_copy(response)?;
            answered += 1;
        }
        Ok(answered)
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
            .max_active_requests_per_client(4)
            .max_response_buffer_size(2)
            .enable_safe_overflow_for_requests(false)
            .enable_safe_overflow_for_responses(true)
            .enable_fire_and_forget_requests(false)
            .open_or_create()
    })
}
