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

mod command;
mod error;
mod plan;
mod stream;

use std::fs;
use std::path::{Path, PathBuf};
use std::string::{String, ToString};
use std::time::Duration;
use std::{format, thread};

use iceoryx2::prelude::{
    Config, FileName, Node, NodeBuilder, NodeName, Path as IoxPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use rustix::time::{ClockId, clock_gettime};
use xxhash_rust::xxh3::xxh3_64;

use crate::service;
use crate::{JointStates, PlanEvent, Setpoint, Telemetry};
pub use command::{CommandClient, CommandServer};
pub use error::{IpcError, PortError};
pub use plan::{PlanPublisher, PlanReceiver, ReceivedPlan};
pub use stream::{Newest, Payload, Receiver, Sender};

use error::Cause;

/// How often an operation is tried again when other processes create or remove the same service.
const ATTEMPTS: u32 = 40;
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(25);
/// Shared memory that must be free before any port is made: all ports but the plan's together.
const SHM_RESERVE: u64 = 1 << 20;

/// Nanoseconds on `CLOCK_MONOTONIC`, the one clock of every stamp. No syscall (vDSO).
#[must_use]
pub fn now_ns() -> u64 {
    let t = clock_gettime(ClockId::Monotonic);
    t.tv_sec.unsigned_abs() * 1_000_000_000 + t.tv_nsec.unsigned_abs()
}

/// Bytes that are free in `/dev/shm`; `None` where it cannot be asked.
///
/// Creating a segment succeeds on a full `/dev/shm`, and filling it then kills the process with
/// SIGBUS: so ask first.
#[must_use]
pub fn free_shared_memory() -> Option<u64> {
    rustix::fs::statvfs("/dev/shm").ok().map(|s| s.f_bavail * s.f_frsize)
}

/// The door to one robot's services.
pub struct Ipc {
    node: Node<ipc::Service>,
    robot: String,
    root: Option<PathBuf>,
}

impl core::fmt::Debug for Ipc {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Ipc").field("robot", &self.robot).field("root", &self.root).finish()
    }
}

impl Ipc {
    /// Opens the door to `robot`'s services. `root` isolates this system from others on the
    /// machine (it is created where missing); `None` is iceoryx2's own default.
    pub fn open(robot: &str, root: Option<&Path>) -> Result<Self, IpcError> {
        if robot.is_empty()
            || !robot.bytes().all(|b| b.is_ascii_alphanumeric() || b"_-.".contains(&b))
        {
            return Err(IpcError::RobotName { name: robot.into() });
        }
        need_shared_memory(SHM_RESERVE)?;
        let config = config(root)?;
        let name = NodeName::new(&format!("nullsweep-{robot}"))
            .map_err(|_| IpcError::RobotName { name: robot.into() })?;
        let node = retry(robot, root, || {
            NodeBuilder::new()
                .name(&name)
                // The binaries have their own handlers: a stop on the path takes time.
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .config(&config)
                .create::<ipc::Service>()
        })?;
        Ok(Self { node, robot: robot.into(), root: root.map(Path::to_path_buf) })
    }

    /// The robot's name in the services' names.
    #[must_use]
    pub fn robot(&self) -> &str {
        &self.robot
    }

    /// The root path, `None` for iceoryx2's own default.
    #[must_use]
    pub fn root(&self) -> Option<&Path> {
        self.root.as_deref()
    }

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

    /// Removes what processes that died left behind; how many were swept. A sweep takes
    /// milliseconds and makes system calls: keep it off the real-time thread.
    pub fn sweep_dead_nodes(&self) -> u64 {
        self.node.try_cleanup_dead_nodes().cleanups
    }

    fn service_name(&self, last: &str) -> Result<ServiceName, IpcError> {
        let name = format!("nullsweep/{}/{last}", self.robot);
        ServiceName::new(&name).map_err(|_| IpcError::RobotName { name: self.robot.clone() })
    }

    fn retry<T, E: Into<Cause>>(
        &self,
        what: &str,
        attempt: impl FnMut() -> Result<T, E>,
    ) -> Result<T, IpcError> {
        retry(what, self.root(), attempt)
    }
}

/// Tries again, a bounded number of times, while other processes create or remove the same thing.
fn retry<T, E: Into<Cause>>(
    what: &str,
    root: Option<&Path>,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, IpcError> {
    let mut left = ATTEMPTS;
    loop {
        match attempt().map_err(Into::into) {
            Ok(made) => return Ok(made),
            Err(Cause::InFlux(_)) if left > 1 => {
                left -= 1;
                thread::sleep(PAUSE);
            }
            Err(cause) => return Err(cause.error(what, root, ATTEMPTS)),
        }
    }
}

/// An error where less shared memory is free than `need`. \[bytes\]
fn need_shared_memory(need: u64) -> Result<(), IpcError> {
    match free_shared_memory() {
        Some(free) if free < need => Err(IpcError::SharedMemoryFull { need, free }),
        _ => Ok(()),
    }
}

fn config(root: Option<&Path>) -> Result<Config, IpcError> {
    let Some(root) = root else { return Ok(Config::global_config().clone()) };
    let bad = |reason: String| IpcError::Root { path: root.to_path_buf(), reason };
    fs::create_dir_all(root).map_err(|e| bad(e.to_string()))?;
    // Two ways to write one folder must give one system.
    let canonical = root.canonicalize().map_err(|e| bad(e.to_string()))?;
    let bytes = canonical.as_os_str().as_encoded_bytes();
    let path = IoxPath::new(bytes).map_err(|e| bad(format!("{e:?}")))?;
    let prefix = format!("nsw_{:08x}_", xxh3_64(bytes) >> 32);
    let prefix = FileName::new(prefix.as_bytes()).map_err(|e| bad(format!("{e:?}")))?;
    let mut config = Config::default();
    config.global.set_root_path(&path);
    config.global.prefix = prefix;
    Ok(config)
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

    #[test]
    fn a_full_shared_memory_is_told_before_it_kills() {
        let e = need_shared_memory(u64::MAX).unwrap_err();
        assert!(matches!(e, IpcError::SharedMemoryFull { .. }), "{e}");
        assert!(need_shared_memory(0).is_ok());
    }

    #[test]
    fn the_clock_rises() {
        let first = now_ns();
        assert!(first > 0 && now_ns() >= first);
    }
}
