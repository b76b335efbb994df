//! Why something in shared memory could not be made, and what to tell the user.

use std::{fmt::Debug, io, path::Path};

use iceoryx2::{
    port::{
        listener::ListenerCreateError,
        notifier::NotifierCreateError,
        publisher::PublisherCreateError,
        reader::{EntryHandleError, ReaderCreateError},
        subscriber::SubscriberCreateError,
        writer::{EntryHandleMutError, WriterCreateError},
    },
    service::builder::{
        blackboard::{BlackboardCreateError, BlackboardOpenError},
        event::{EventOpenError, EventOpenOrCreateError},
        publish_subscribe::{PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError},
    },
    service::service_name::ServiceNameError,
};

use super::resources;
use crate::bus::BusError;

/// Why an attempt failed.
pub enum Refusal {
    /// Waiting does not help.
    Final(BusError),
    /// Somebody who dies may be about to make room.
    Perhaps(BusError),
}

/// What iceoryx2 said.
pub enum Trouble {
    /// Others have made the service otherwise than we would.
    Differs,
    /// As many as may write the topic do so.
    Taken,
    /// As many as may take part do so.
    Crowded,
    /// The system said no.
    System(io::Error),
    /// Something else, in iceoryx2's words.
    Other(String),
}

impl Trouble {
    /// What it means for a topic of a session.
    pub fn at(self, topic: &str, session: &str, root: &Path) -> Refusal {
        let settings = |reason| {
            BusError::Settings(format!(
                "session '{session}' {reason}, or choose another name with --session"
            ))
        };
        match self {
            Self::Differs => Refusal::Final(settings(
                "is used by another version of mtj; run the same mtj in all its processes"
                    .to_owned(),
            )),
            Self::Taken => Refusal::Perhaps(settings(format!(
                "has as many processes that write '{topic}' as it may have; stop one"
            ))),
            Self::Crowded => Refusal::Perhaps(settings(format!(
                "has as many processes at '{topic}' as it may have; stop one"
            ))),
            Self::System(error) => Refusal::Final(resources::io(root, &error)),
            Self::Other(words) => Refusal::Perhaps(resources::explain(root, topic, &words)),
        }
    }

    fn other(error: impl Debug) -> Self {
        Self::Other(format!("{error:?}"))
    }
}

impl From<PublishSubscribeOpenOrCreateError> for Trouble {
    fn from(error: PublishSubscribeOpenOrCreateError) -> Self {
        use PublishSubscribeOpenError as E;
        match error {
            PublishSubscribeOpenOrCreateError::PublishSubscribeOpenError(open) => match open {
                E::IncompatibleTypes
                | E::IncompatibleMessagingPattern
                | E::IncompatibleAttributes
                | E::IncompatibleOverflowBehavior
                | E::DoesNotSupportRequestedMinBufferSize
                | E::DoesNotSupportRequestedMinHistorySize
                | E::DoesNotSupportRequestedMinSubscriberBorrowedSamples
                | E::DoesNotSupportRequestedAmountOfPublishers
                | E::DoesNotSupportRequestedAmountOfSubscribers
                | E::DoesNotSupportRequestedAmountOfNodes
                | E::VersionMismatch => Self::Differs,
                E::ExceedsMaxNumberOfNodes => Self::Crowded,
                open => Self::other(open),
            },
            error => Self::other(error),
        }
    }
}

impl From<EventOpenOrCreateError> for Trouble {
    fn from(error: EventOpenOrCreateError) -> Self {
        use EventOpenError as E;
        match error {
            EventOpenOrCreateError::EventOpenError(open) => match open {
                E::IncompatibleMessagingPattern
                | E::IncompatibleAttributes
                | E::IncompatibleDeadline
                | E::IncompatibleNotifierCreatedEvent
                | E::IncompatibleNotifierDroppedEvent
                | E::IncompatibleNotifierDeadEvent
                | E::DoesNotSupportRequestedAmountOfNotifiers
                | E::DoesNotSupportRequestedAmountOfListeners
                | E::DoesNotSupportRequestedMaxEventId
                | E::DoesNotSupportRequestedAmountOfNodes
                | E::VersionMismatch => Self::Differs,
                E::ExceedsMaxNumberOfNodes => Self::Crowded,
                open => Self::other(open),
            },
            error => Self::other(error),
        }
    }
}

impl From<PublisherCreateError> for Trouble {
    fn from(error: PublisherCreateError) -> Self {
        match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers => Self::Taken,
            error => Self::other(error),
        }
    }
}

impl From<SubscriberCreateError> for Trouble {
    fn from(error: SubscriberCreateError) -> Self {
        match error {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => Self::Crowded,
            error => Self::other(error),
        }
    }
}

impl From<NotifierCreateError> for Trouble {
    fn from(error: NotifierCreateError) -> Self {
        match error {
            NotifierCreateError::ExceedsMaxSupportedNotifiers => Self::Crowded,
            error => Self::other(error),
        }
    }
}

impl From<ListenerCreateError> for Trouble {
    fn from(error: ListenerCreateError) -> Self {
        match error {
            ListenerCreateError::ExceedsMaxSupportedListeners => Self::Crowded,
            error => Self::other(error),
        }
    }
}

macro_rules! something_else {
    ($($error:ident),*) => {
        $(impl From<$error> for Trouble {
            fn from(error: $error) -> Self {
                Self::other(error)
            }
        })*
    };
}

something_else! {
    ServiceNameError, BlackboardCreateError, BlackboardOpenError, WriterCreateError,
    EntryHandleMutError, ReaderCreateError, EntryHandleError
}

impl From<io::Error> for Trouble {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}
