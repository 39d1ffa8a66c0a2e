//! A process's (or thread's) node among a robot's services, and the shared memory that they need.

use std::fs;
use std::path::{Path, PathBuf};
use std::string::{String, ToString};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use std::{format, io, thread};

use iceoryx2::prelude::{
    Config, FileName, Node, NodeBuilder, NodeName, Path as IoxPath, SemanticString, ServiceName,
    SignalHandlingMode, ipc,
};
use xxhash_rust::xxh3::xxh3_64;

use super::cause::Cause;
use super::error::IpcError;
use super::owner::{Foreign, foreign};
use super::spoilt;

/// How long an operation is tried again when other processes create or remove the same service.
const RETRY_WITHIN: Duration = Duration::from_secs(3);
/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(25);
/// How long making a node may take, whatever it waits for.
const NODE_WITHIN: Duration = Duration::from_secs(6);
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
    prefix: String,
}

impl core::fmt::Debug for Ipc {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Ipc").field("robot", &self.robot).field("root", &self.root).finish()
    }
}

impl Ipc {
    /// Opens the door to `robot`'s services. `root` isolates this system from others on the
    /// machine (it is created where missing); `None` is iceoryx2's own default. Takes a few seconds
    /// at most, whatever is in the way.
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
        let prefix = config.global.prefix.to_string();
        let (what, place, own) = (robot.to_string(), root.map(Path::to_path_buf), prefix.clone());
        let made = within(NODE_WITHIN, move || {
            retry(&what, place.as_deref(), &own, || {
                NodeBuilder::new()
                    .name(&name)
                    // The binaries have their own handlers: a stop on the path takes time.
                    .signal_handling_mode(SignalHandlingMode::Disabled)
                    .config(&config)
                    .create::<ipc::Service>()
            })
        });
        let node = made.map_err(|e| stuck(robot, &prefix, &e))??;
        if root.is_some() {
            spoilt::keep_counter(&prefix);
        }
        Ok(Self { node, robot: robot.into(), root: root.map(Path::to_path_buf), prefix })
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

    /// What the names of this system's files in `/dev/shm` begin with.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
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
        retry(what, self.root(), &self.prefix, attempt)
    }
}

/// Tries again, for a bounded time, while other processes create or remove the same thing.
fn retry<T, E: Into<Cause>>(
    what: &str,
    root: Option<&Path>,
    prefix: &str,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, IpcError> {
    let start = Instant::now();
    loop {
        let late = start.elapsed() >= RETRY_WITHIN;
        // One that is just being made has a length a moment later.
        match spoilt::empty(prefix) {
            Some(empty) if late => return Err(IpcError::spoilt(what, empty, "it is empty")),
            Some(_) => {}
            None => match attempt().map_err(Into::into) {
                Ok(made) => return Ok(made),
                Err(Cause::InFlux(_)) if !late => {}
                Err(Cause::Counter(detail)) => return Err(no_number(what, root, prefix, detail)),
                Err(cause) => {
                    return Err(cause.error(what, root, start.elapsed(), in_the_way(root)));
                }
            },
        }
        thread::sleep(PAUSE);
    }
}

/// A node got no number: its counter is another user's, or damaged.
fn no_number(what: &str, root: Option<&Path>, prefix: &str, detail: String) -> IpcError {
    match (in_the_way(root), spoilt::counter(prefix)) {
        (None, Some(counter)) => IpcError::spoilt(what, counter, &detail),
        (foreign, _) => Cause::Permission(detail).error(what, root, Duration::ZERO, foreign),
    }
}

/// Does something in a thread of its own, which is left behind where it takes longer than `limit`.
///
/// # Errors
/// [`io::ErrorKind::TimedOut`] then, or what keeps the thread from being started.
pub fn within<T: Send + 'static>(
    limit: Duration,
    make: impl FnOnce() -> T + Send + 'static,
) -> io::Result<T> {
    let (sender, made) = mpsc::sync_channel(1);
    thread::Builder::new().name("ipc".into()).spawn(move || sender.send(make()))?;
    made.recv_timeout(limit).map_err(|_| io::ErrorKind::TimedOut.into())
}

fn stuck(what: &str, prefix: &str, e: &io::Error) -> IpcError {
    match spoilt::empty(prefix) {
        Some(empty) => IpcError::spoilt(what, empty, "it is empty"),
        None => IpcError::Other { what: what.into(), detail: e.to_string() },
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
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_full_shared_memory_is_told_before_it_kills() {
        let e = need_shared_memory(u64::MAX).unwrap_err();
        assert!(matches!(e, IpcError::SharedMemoryFull { .. }), "{e}");
        assert!(need_shared_memory(0).is_ok());
    }

    /// Opens a second door while the node counter holds `content`: how long it took, the counter,
    /// and what was said.
    fn opened(content: &[u8]) -> (Duration, PathBuf, IpcError) {
        let root = tempfile::TempDir::new().unwrap();
        let first = Ipc::open("pr2", Some(root.path())).unwrap();
        let counter = spoilt::counter(&first.prefix).unwrap().file;
        let mode = fs::metadata(&counter).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "nobody else writes to it");
        fs::write(&counter, content).unwrap();
        let start = Instant::now();
        let e = Ipc::open("pr2", Some(root.path())).unwrap_err();
        let took = start.elapsed();
        // Who has a node needs no number any more.
        if !content.is_empty() {
            first.telemetry_sender().unwrap();
        }
        // The remedy that is told is one.
        fs::remove_file(&counter).unwrap();
        Ipc::open("pr2", Some(root.path())).unwrap();
        fs::remove_file(&counter).unwrap();
        (took, counter, e)
    }

    #[test]
    fn a_damaged_node_counter_is_told_within_seconds() {
        for content in [&b""[..], &[0; 3], &[0; 16], &[0xab; 16]] {
            let (took, counter, e) = opened(content);
            assert!(took < 2 * NODE_WITHIN, "{content:?}: {took:?}");
            let told = format!("pr2: {}, which belongs to ", counter.display());
            let text = e.to_string();
            assert!(text.starts_with(&told) && text.contains("remove it and try again"), "{text}");
        }
    }

    #[test]
    fn an_empty_segment_is_told_at_every_port() {
        let root = tempfile::TempDir::new().unwrap();
        let ipc = Ipc::open("pr2", Some(root.path())).unwrap();
        let left = PathBuf::from(format!("/dev/shm/{}left_behind", ipc.prefix));
        fs::write(&left, "").unwrap();
        let text = ipc.telemetry_receiver().unwrap_err().to_string();
        fs::remove_file(&left).unwrap();
        assert!(
            text.starts_with("telemetry: /dev/shm/nsw_") && text.contains("it is empty"),
            "{text}"
        );
        ipc.telemetry_receiver().unwrap();
        let _ = fs::remove_file(spoilt::counter(&ipc.prefix).unwrap().file);
    }

    #[test]
    fn what_takes_for_ever_is_left_behind() {
        let limit = Duration::from_millis(20);
        let e = within(limit, || thread::sleep(Duration::from_secs(60))).unwrap_err();
        assert_eq!(e.kind(), io::ErrorKind::TimedOut);
        assert_eq!(within(limit * 100, || 5).unwrap(), 5);
    }
}
