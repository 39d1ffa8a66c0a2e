//! iceoryx2's errors, by what is to be done about them.

use std::format;
use std::path::Path;
use std::string::String;
use std::time::Duration;

use iceoryx2::node::NodeCreationFailure;
use iceoryx2::port::publisher::PublisherCreateError;
use iceoryx2::port::subscriber::SubscriberCreateError;
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

use super::error::IpcError;
use super::owner::Foreign;

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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::super::owner::User;
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
