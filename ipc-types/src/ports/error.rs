//! What can go wrong at a port, in words that say what to do.

use std::format;
use std::path::{Path, PathBuf};
use std::string::String;
use std::time::Duration;

use iceoryx2::node::NodeCreationFailure;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::subscriber::SubscriberCreateError;
use iceoryx2::port::{LoanError, ReceiveError, SendError};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError as PsCreate, PublishSubscribeOpenError as PsOpen,
    PublishSubscribeOpenOrCreateError as Ps,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError as RrCreate, RequestResponseOpenError as RrOpen,
    RequestResponseOpenOrCreateError as Rr,
};
use iceoryx2::service::port_factory::client::ClientCreateError;
use iceoryx2::service::port_factory::server::ServerCreateError;

use super::owner::{Foreign, User};
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
    #[error("nothing answers for the base of robot `{robot}`, and no program waits for it")]
    NoBase {
        /// The robot's name.
        robot: String,
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

/// iceoryx2's many errors, sorted by what is to be done.
pub(super) enum Cause {
    InFlux(String),
    Taken(String),
    Incompatible(String),
    Permission(String),
    /// A node gets no number.
    Counter(String),
    Other(String),
}

impl Cause {
    pub(super) fn error(
        self,
        what: &str,
        root: Option<&Path>,
        tried: Duration,
        foreign: Option<Foreign>,
    ) -> IpcError {
        let what = String::from(what);
        // What another user's files cause has many names.
        if let (Self::InFlux(detail) | Self::Permission(detail) | Self::Other(detail), Some(f)) =
            (&self, foreign)
        {
            let detail = detail.clone();
            return IpcError::OtherUser { what, file: f.file, owner: f.owner, own: f.own, detail };
        }
        match self {
            Self::InFlux(detail) => IpcError::InFlux { what, tried, detail },
            Self::Taken(detail) => IpcError::Taken { what, detail },
            Self::Incompatible(detail) => IpcError::Incompatible { what, detail },
            Self::Permission(detail) | Self::Counter(detail) => {
                IpcError::Permission { what, root: root.map(Path::to_path_buf), detail }
            }
            Self::Other(detail) => IpcError::Other { what, detail },
        }
    }
}

impl From<Ps> for Cause {
    fn from(e: Ps) -> Self {
        let text = format!("{e:?}");
        match e {
            Ps::SystemInFlux
            | Ps::PublishSubscribeOpenError(
                PsOpen::ServiceInCorruptedState
                | PsOpen::IsMarkedForDestruction
                | PsOpen::HangsInCreation
                | PsOpen::DoesNotExist
                | PsOpen::UnableToCreateServiceTag,
            )
            | Ps::PublishSubscribeCreateError(
                PsCreate::ServiceInCorruptedState
                | PsCreate::AlreadyExists
                | PsCreate::IsBeingCreatedByAnotherInstance
                | PsCreate::HangsInCreation
                | PsCreate::UnableToCreateServiceTag,
            ) => Self::InFlux(text),
            Ps::PublishSubscribeOpenError(PsOpen::InsufficientPermissions)
            | Ps::PublishSubscribeCreateError(PsCreate::InsufficientPermissions) => {
                Self::Permission(text)
            }
            Ps::PublishSubscribeOpenError(PsOpen::ExceedsMaxNumberOfNodes) => Self::Taken(text),
            Ps::PublishSubscribeOpenError(
                PsOpen::IncompatibleTypes
                | PsOpen::IncompatibleMessagingPattern
                | PsOpen::IncompatibleAttributes
                | PsOpen::IncompatibleOverflowBehavior
                | PsOpen::DoesNotSupportRequestedMinBufferSize
                | PsOpen::DoesNotSupportRequestedMinHistorySize
                | PsOpen::DoesNotSupportRequestedMinSubscriberBorrowedSamples
                | PsOpen::DoesNotSupportRequestedAmountOfPublishers
                | PsOpen::DoesNotSupportRequestedAmountOfSubscribers
                | PsOpen::DoesNotSupportRequestedAmountOfNodes
                | PsOpen::VersionMismatch,
            ) => Self::Incompatible(text),
            _ => Self::Other(text),
        }
    }
}

impl From<Rr> for Cause {
    fn from(e: Rr) -> Self {
        let text = format!("{e:?}");
        match e {
            Rr::SystemInFlux
            | Rr::RequestResponseOpenError(
                RrOpen::ServiceInCorruptedState
                | RrOpen::IsMarkedForDestruction
                | RrOpen::HangsInCreation
                | RrOpen::DoesNotExist
                | RrOpen::UnableToCreateServiceTag,
            )
            | Rr::RequestResponseCreateError(
                RrCreate::ServiceInCorruptedState
                | RrCreate::AlreadyExists
                | RrCreate::IsBeingCreatedByAnotherInstance
                | RrCreate::HangsInCreation,
            ) => Self::InFlux(text),
            Rr::RequestResponseOpenError(RrOpen::InsufficientPermissions)
            | Rr::RequestResponseCreateError(RrCreate::InsufficientPermissions) => {
                Self::Permission(text)
            }
            Rr::RequestResponseOpenError(RrOpen::ExceedsMaxNumberOfNodes) => Self::Taken(text),
            Rr::RequestResponseOpenError(RrOpen::InternalFailure | RrOpen::Interrupt)
            | Rr::RequestResponseCreateError(_) => Self::Other(text),
            Rr::RequestResponseOpenError(_) => Self::Incompatible(text),
        }
    }
}

impl From<NodeCreationFailure> for Cause {
    fn from(e: NodeCreationFailure) -> Self {
        let text = format!("{e:?}");
        match e {
            NodeCreationFailure::InsufficientPermissions => Self::Permission(text),
            NodeCreationFailure::UnableToGenerateUniqueNodeId => Self::Counter(text),
            NodeCreationFailure::SystemCorrupted => Self::InFlux(text),
            NodeCreationFailure::InternalError => Self::Other(text),
        }
    }
}

impl From<PublisherCreateError> for Cause {
    fn from(e: PublisherCreateError) -> Self {
        let text = format!("{e:?}");
        match e {
            PublisherCreateError::ExceedsMaxSupportedPublishers => Self::Taken(text),
            PublisherCreateError::UnableToCreatePortTag => Self::InFlux(text),
            _ => Self::Other(text),
        }
    }
}

impl From<SubscriberCreateError> for Cause {
    fn from(e: SubscriberCreateError) -> Self {
        let text = format!("{e:?}");
        match e {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => Self::Taken(text),
            SubscriberCreateError::UnableToCreatePortTag => Self::InFlux(text),
            _ => Self::Other(text),
        }
    }
}

impl From<ServerCreateError> for Cause {
    fn from(e: ServerCreateError) -> Self {
        let text = format!("{e:?}");
        match e {
            ServerCreateError::ExceedsMaxSupportedServers => Self::Taken(text),
            _ => Self::Other(text),
        }
    }
}

impl From<ClientCreateError> for Cause {
    fn from(e: ClientCreateError) -> Self {
        let text = format!("{e:?}");
        match e {
            ClientCreateError::ExceedsMaxSupportedClients => Self::Taken(text),
            _ => Self::Other(text),
        }
    }
}

fn shown(root: &Option<PathBuf>) -> String {
    root.as_ref().map_or_else(|| String::from("iceoryx2's root"), |p| format!("{}", p.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_users_robot_is_told_whatever_iceoryx2_calls_it() {
        let foreign = || {
            let file = PathBuf::from("elsewhere/nodes");
            Some(Foreign { file, owner: User { uid: 4_000_001 }, own: User { uid: 4_000_002 } })
        };
        for cause in [
            NodeCreationFailure::InternalError.into(),
            NodeCreationFailure::InsufficientPermissions.into(),
            NodeCreationFailure::SystemCorrupted.into(),
            PublisherCreateError::UnableToCreatePortTag.into(),
            Cause::from(Ps::PublishSubscribeOpenError(PsOpen::InternalFailure)),
        ] {
            let text = format!("{}", cause.error("state", None, Duration::ZERO, foreign()));
            let told = "state: another user's robot or folder: elsewhere/nodes belongs to uid \
                        4000001, and this process runs as uid 4000002 (";
            assert!(text.starts_with(told), "{text}");
            assert!(text.contains("or give this system a root path of its own"), "{text}");
        }
        // What is wrong for another reason stays so.
        let full = Cause::from(ServerCreateError::ExceedsMaxSupportedServers);
        assert!(matches!(
            full.error("command", None, Duration::ZERO, foreign()),
            IpcError::Taken { .. }
        ));
        let other = Cause::from(NodeCreationFailure::InternalError);
        assert!(matches!(other.error("node", None, Duration::ZERO, None), IpcError::Other { .. }));
    }
}
