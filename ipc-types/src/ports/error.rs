//! What can go wrong at a port, in words that say what to do.

use std::format;
use std::path::PathBuf;
use std::string::String;
use std::time::Duration;

use iceoryx2::port::{LoanError, ReceiveError, SendError};

use super::owner::User;
use super::spoilt::Spoilt;

/// Why a port could not be opened, or a plan or command not delivered.
#[derive(Debug, thiserror::Error)]
pub enum IpcError {
    /// Nobody answers for this robot.
    #[error(
        "no executor is running for robot `{robot}` under {}: start `executor run --robot-name \
         {robot}`; one under another root path is found by --ipc-root, or by a cell file's ipc_root",
        shown(.root)
    )]
    NoExecutor {
        /// The robot's name.
        robot: String,
        /// The root path, `None` for the default.
        root: Option<PathBuf>,
    },
    /// Nothing moves this robot's base, and nobody waits for it.
    #[error(
        "nothing answers for the base of robot `{robot}` under {}, and no program waits for it: \
         `planner publish PROGRAM` does, by the same --robot-name and --ipc-root",
        shown(.root)
    )]
    NoBase {
        /// The robot's name.
        robot: String,
        /// The root path, `None` for the default.
        root: Option<PathBuf>,
    },
    /// What moves the base did not answer in time.
    #[error("what moves the base of robot `{robot}` did not answer within {millis} ms")]
    MuteBase {
        /// The robot's name.
        robot: String,
        /// How long was waited. \[ms\]
        millis: u128,
    },
    /// The service's only place is taken.
    #[error(
        "{what}: all places are taken ({detail}); is another one running under this root path?"
    )]
    Taken {
        /// Which service.
        what: String,
        /// What iceoryx2 says.
        detail: String,
    },
    /// The other side has other types, QoS or another version of iceoryx2.
    #[error("{what}: the other side was built from another version ({detail})")]
    Incompatible {
        /// Which service.
        what: String,
        /// What iceoryx2 says.
        detail: String,
    },
    /// A file belongs to another user, who runs this robot.
    #[error(
        "{what}: another user's robot or folder: {} belongs to {owner}, and this process runs as \
         {own} ({detail}); run every process as {owner}, or give this system a root path of its \
         own (--ipc-root)",
        .file.display()
    )]
    OtherUser {
        /// Which service.
        what: String,
        /// The file or folder.
        file: PathBuf,
        /// Whose it is.
        owner: User,
        /// Who this process is.
        own: User,
        /// What iceoryx2 or the system says.
        detail: String,
    },
    /// Files or segments may not be used.
    #[error(
        "{what}: no permission for the files under {} or their segments in /dev/shm ({detail}); \
         run every process as one user, or give each its own root path",
        shown(.root)
    )]
    Permission {
        /// Which service.
        what: String,
        /// The root path, `None` for the default.
        root: Option<PathBuf>,
        /// What iceoryx2 says.
        detail: String,
    },
    /// Less shared memory is free than is needed.
    #[error(
        "/dev/shm has {free} bytes free, {need} are needed; in Docker, raise it with `--shm-size`"
    )]
    SharedMemoryFull {
        /// \[bytes\]
        need: u64,
        /// \[bytes\]
        free: u64,
    },
    /// A file of iceoryx2's is half made or damaged.
    #[error(
        "{what}: {}, which belongs to {owner}, is of no use ({detail}): a process died while it \
         made it, or another user wrote to it; remove it and try again: no process that runs needs \
         it",
        .file.display()
    )]
    Spoilt {
        /// Which service.
        what: String,
        /// The file.
        file: PathBuf,
        /// Whose it is.
        owner: User,
        /// What is wrong with it.
        detail: String,
    },
    /// Others kept creating and removing it, or a crash left it half made.
    #[error(
        "{what}: still in flux after {:.1} s ({detail}); stop the others and retry",
        .tried.as_secs_f64()
    )]
    InFlux {
        /// Which service.
        what: String,
        /// For how long it was tried.
        tried: Duration,
        /// What iceoryx2 says.
        detail: String,
    },
    /// The robot's name cannot be part of a service's name.
    #[error("`{name}` is no robot name: letters, digits, `_`, `-` and `.` make one")]
    RobotName {
        /// What was given.
        name: String,
    },
    /// The root path cannot be used.
    #[error("root path {}: {reason}", .path.display())]
    Root {
        /// What was given.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A plan has too many or too few knots for this publisher.
    #[error("a plan of {knots} knots: this publisher takes 1 to {limit}")]
    KnotCount {
        /// How many it has.
        knots: usize,
        /// How many may be.
        limit: usize,
    },
    /// The executor did not take the plan since four wait already.
    #[error("the executor's plan buffer is full; wait for the admission of the earlier plans")]
    PlanBufferFull,
    /// The executor did not answer in time.
    #[error("the executor for robot `{robot}` did not answer within {millis} ms")]
    NoAnswer {
        /// The robot's name.
        robot: String,
        /// How long was waited. \[ms\]
        millis: u128,
    },
    /// Sending or receiving failed.
    #[error("{what}: {error}")]
    Port {
        /// Which service.
        what: &'static str,
        /// What happened.
        error: PortError,
    },
    /// Anything else that iceoryx2 reports.
    #[error("{what}: {detail}")]
    Other {
        /// Which service.
        what: String,
        /// What iceoryx2 says.
        detail: String,
    },
}

impl IpcError {
    pub(super) fn spoilt(what: &str, spoilt: Spoilt, detail: &str) -> Self {
        let Spoilt { file, owner } = spoilt;
        Self::Spoilt { what: what.into(), file, owner, detail: detail.into() }
    }
}

/// Why sending or receiving failed. Small, `Copy` and made without allocating: it may arise in
/// the real-time loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PortError {
    /// No sample is free: more are borrowed than the service allows.
    #[error("no free sample")]
    NoSample,
    /// A buffer was full and the sample was discarded.
    #[error("the receiver's buffer is full")]
    Full,
    /// A connection could not be made or is corrupted.
    #[error("a connection is broken")]
    Connection,
    /// Anything else.
    #[error("iceoryx2 failed internally")]
    Internal,
}

impl From<SendError> for PortError {
    fn from(e: SendError) -> Self {
        match e {
            SendError::LoanError(e) => e.into(),
            SendError::UnableToDeliver => Self::Full,
            SendError::ConnectionBrokenSinceSenderNoLongerExists
            | SendError::ConnectionCorrupted
            | SendError::ConnectionError(_) => Self::Connection,
            SendError::InternalError => Self::Internal,
        }
    }
}

impl From<LoanError> for PortError {
    fn from(e: LoanError) -> Self {
        match e {
            LoanError::OutOfMemory | LoanError::ExceedsMaxLoans => Self::NoSample,
            _ => Self::Internal,
        }
    }
}

impl From<ReceiveError> for PortError {
    fn from(e: ReceiveError) -> Self {
        match e {
            ReceiveError::ExceedsMaxBorrows => Self::NoSample,
            ReceiveError::ConnectionFailure(_) => Self::Connection,
        }
    }
}

fn shown(root: &Option<PathBuf>) -> String {
    root.as_ref().map_or_else(|| String::from("iceoryx2's root"), |p| format!("{}", p.display()))
}
