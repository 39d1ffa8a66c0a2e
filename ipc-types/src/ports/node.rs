//! A process's (or thread's) node among a robot's services, and the shared memory that they need.

use std::fs;
use std::path::{Path, PathBuf};
use std::string::{String, ToString};
use std::time::Duration;
use std::{format, thread};

use iceoryx2::prelude::{
    Config, FileName, Node, NodeBuilder, NodeName, Path as IoxPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use xxhash_rust::xxh3::xxh3_64;

use super::error::{Cause, IpcError};
use super::owner::{Foreign, foreign};

/// How often an operation is tried again when other processes create or remove the same service.
const ATTEMPTS: u32 = 40;
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(25);
/// Shared memory that must be free before any port is made: all ports but the plan's together.
const SHM_RESERVE: u64 = 1 << 20;

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
    pub(super) node: Node<ipc::Service>,
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

    /// Removes what processes that died left behind; how many were swept. A sweep takes
    /// milliseconds and makes system calls: keep it off the real-time thread.
    pub fn sweep_dead_nodes(&self) -> u64 {
        self.node.try_cleanup_dead_nodes().cleanups
    }

    pub(super) fn service_name(&self, last: &str) -> Result<ServiceName, IpcError> {
        let name = format!("nullsweep/{}/{last}", self.robot);
        ServiceName::new(&name).map_err(|_| IpcError::RobotName { name: self.robot.clone() })
    }

    pub(super) fn retry<T, E: Into<Cause>>(
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
            Err(cause) => return Err(cause.error(what, root, ATTEMPTS, in_the_way(root))),
        }
    }
}

/// A file of another user's in this system's way.
fn in_the_way(root: Option<&Path>) -> Option<Foreign> {
    // Where the root path cannot be used, it or what it lies in is itself in the way.
    let config = root.map_or_else(|| Ok(Config::global_config().clone()), configured).ok();
    let prefix = config.as_ref().map(|c| c.global.prefix.to_string());
    let default = config.map(|c| PathBuf::from(c.global.root_path().to_string()));
    let place = root.map(Path::to_path_buf).or(default)?;
    foreign(&place, prefix.as_deref())
}

/// An error where less shared memory is free than `need`. \[bytes\]
pub(super) fn need_shared_memory(need: u64) -> Result<(), IpcError> {
    match free_shared_memory() {
        Some(free) if free < need => Err(IpcError::SharedMemoryFull { need, free }),
        _ => Ok(()),
    }
}

fn config(root: Option<&Path>) -> Result<Config, IpcError> {
    let Some(root) = root else { return Ok(Config::global_config().clone()) };
    configured(root).map_err(|reason| match in_the_way(Some(root)) {
        Some(Foreign { file, owner, own }) => {
            let what = format!("root path {}", root.display());
            IpcError::OtherUser { what, file, owner, own, detail: reason }
        }
        None => IpcError::Root { path: root.to_path_buf(), reason },
    })
}

/// The settings of a root path, which is made where it is missing.
fn configured(root: &Path) -> Result<Config, String> {
    fs::create_dir_all(root).map_err(|e| e.to_string())?;
    // Two names of one folder must give one system.
    let canonical = root.canonicalize().map_err(|e| e.to_string())?;
    let bytes = canonical.as_os_str().as_encoded_bytes();
    let path = IoxPath::new(bytes).map_err(|e| format!("{e:?}"))?;
    let prefix = format!("nsw_{:08x}_", xxh3_64(bytes) >> 32);
    let prefix = FileName::new(prefix.as_bytes()).map_err(|e| format!("{e:?}"))?;
    let mut config = Config::default();
    config.global.set_root_path(&path);
    config.global.prefix = prefix;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_shared_memory_is_told_before_it_kills() {
        let e = need_shared_memory(u64::MAX).unwrap_err();
        assert!(matches!(e, IpcError::SharedMemoryFull { .. }), "{e}");
        assert!(need_shared_memory(0).is_ok());
    }
}
