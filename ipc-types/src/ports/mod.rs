//! Builders that open each service with its one quality of service.
//!
//! [`Ipc`] is one process's (or one thread's) door to a robot's services: it owns the iceoryx2
//! node, from which every port is made. Ports are `!Send`: make them on the thread that uses
//! them. [`Ipc`] itself may be sent to another thread.
//!
//! A root path isolates a whole system (executor, endpoint, planners) from every other one on
//! the machine. Service and node files live below it; the segments in `/dev/shm` lie in one flat
//! folder, so a root of one's own also gets a prefix of its own there, which is what lets two
//! users on one machine run side by side.

mod base;
mod cause;
mod clock;
mod command;
mod error;
mod inquiry;
mod node;
mod owner;
mod plan;
mod schema;
mod spoilt;
mod stream;

use crate::service;
use crate::{JointStates, PlanEvent, Setpoint, Telemetry};
pub use base::{BaseClient, BaseRequest, BaseServer};
pub use clock::now_ns;
pub use command::{Asked, CommandClient, CommandServer, Request};
pub use error::{IpcError, PortError};
pub use node::{Ipc, free_shared_memory, within};
pub use owner::User;
pub use plan::{PlanPublisher, PlanReceiver, ReceivedPlan};
pub use schema::{Shape, schema};
pub use stream::{Newest, Payload, Receiver, Sender};

impl Ipc {
    /// A plan publisher whose segment is sized to plans of up to `max_knots` knots.
    pub fn plan_publisher(&self, max_knots: usize) -> Result<PlanPublisher, IpcError> {
        PlanPublisher::open(self, max_knots)
    }

    /// The executor's end of the plan service. There is one.
    pub fn plan_receiver(&self) -> Result<PlanReceiver, IpcError> {
        PlanReceiver::open(self)
    }

    /// The executor's end of the setpoint service. There is one.
    pub fn setpoint_sender(&self) -> Result<Sender<Setpoint>, IpcError> {
        Sender::open(self, &service::SETPOINT)
    }

    /// The hardware endpoint's end of the setpoint service. There is one.
    pub fn setpoint_receiver(&self) -> Result<Receiver<Setpoint>, IpcError> {
        Receiver::open(self, &service::SETPOINT)
    }

    /// The hardware endpoint's end of the state service. There is one.
    pub fn state_sender(&self) -> Result<Sender<JointStates>, IpcError> {
        Sender::open(self, &service::STATE)
    }

    /// The executor's end of the state service. There is one.
    pub fn state_receiver(&self) -> Result<Receiver<JointStates>, IpcError> {
        Receiver::open(self, &service::STATE)
    }

    /// The executor's end of the telemetry service. There is one.
    pub fn telemetry_sender(&self) -> Result<Sender<Telemetry>, IpcError> {
        Sender::open(self, &service::TELEMETRY)
    }

    /// Listens to telemetry; a late one gets the last snapshot.
    pub fn telemetry_receiver(&self) -> Result<Receiver<Telemetry>, IpcError> {
        Receiver::open(self, &service::TELEMETRY)
    }

    /// The executor's end of the plan event service. There is one.
    pub fn event_sender(&self) -> Result<Sender<PlanEvent>, IpcError> {
        Sender::open(self, &service::PLAN_EVENT)
    }

    /// Listens to plan events. A late one gets the last 16, of earlier plans too: open it before
    /// publishing and compare ids.
    pub fn event_receiver(&self) -> Result<Receiver<PlanEvent>, IpcError> {
        Receiver::open(self, &service::PLAN_EVENT)
    }

    /// The executor's end of the command service. There is one.
    pub fn command_server(&self) -> Result<CommandServer, IpcError> {
        CommandServer::open(self)
    }

    /// An operator's end of the command service.
    pub fn command_client(&self) -> Result<CommandClient, IpcError> {
        CommandClient::open(self)
    }

    /// The end of what moves the robot's base. There is one.
    pub fn base_server(&self) -> Result<BaseServer, IpcError> {
        BaseServer::open(self)
    }

    /// The end of whoever asks for a pose of the base, or says that it was reached.
    pub fn base_client(&self) -> Result<BaseClient, IpcError> {
        BaseClient::open(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_type_under_the_name_is_incompatible() {
        let root = tempfile::TempDir::new().unwrap();
        let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
        let name = ipc.service_name(service::SETPOINT.name).unwrap();
        let stranger =
            ipc.node.service_builder(&name).publish_subscribe::<u64>().open_or_create().unwrap();
        let e = ipc.setpoint_sender().unwrap_err();
        assert!(matches!(e, IpcError::Incompatible { .. }), "{e}");
        drop(stranger);
        ipc.setpoint_sender().unwrap();
    }
}
