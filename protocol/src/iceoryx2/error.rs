//! Why something in shared memory could not be created, and what the user can do.

use std::{
    error::Error,
    io,
    path::{Path, PathBuf},
    time::Duration,
};

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
use nix::errno::Errno;

use super::resources::{self, DESCRIPTORS, MAX_OFFER, MEMORY};
use crate::{
    bus::BusError,
    sample::{Sample, StateSample},
};

/// Why shared memory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SharedMemoryError {
    /// Another user owns the directory of our domain.
    #[error(
        "{} is not a directory of this user; have it removed, it is where mtj keeps what its \
         processes share",
        .0.display()
    )]
    ForeignDirectory(PathBuf),
    /// The session's topics have another layout.
    #[error(
        "session '{session}' is used by another version of mtj; run the same mtj in all its \
         processes, or choose another name with --session"
    )]
    OtherVersion {
        /// The session's name.
        session: String,
    },
    /// The session has a plant.
    #[error(
        "session '{session}' has a plant already; stop it, or choose another name with --session"
    )]
    SecondPlant {
        /// The session's name.
        session: String,
    },
    /// A topic has no room for another writer.
    #[error(
        "session '{session}' has as many processes that write '{topic}' as it may have; stop one, \
         or choose another name with --session"
    )]
    TooManyWriters {
        /// The session's name.
        session: String,
        /// The topic.
        topic: String,
    },
    /// A topic has no room for another process.
    #[error(
        "session '{session}' has as many processes at '{topic}' as it may have; stop one, or \
         choose another name with --session"
    )]
    TooManyMembers {
        /// The session's name.
        session: String,
        /// The topic.
        topic: String,
    },
    /// The scenario does not fit.
    #[error("the scenario is {length} bytes long; shared memory takes up to {MAX_OFFER}")]
    OfferTooLong {
        /// Its length, bytes.
        length: usize,
    },
    /// Another process holds the domain's lock.
    #[error(
        "shared memory: process {holder} has held {} for {} s while it starts or ends; if it is \
         stopped, let it go on or kill it",
        file.display(),
        patience.as_secs()
    )]
    Locked {
        /// The process that holds it.
        holder: String,
        /// The lock.
        file: PathBuf,
        /// How long we waited.
        patience: Duration,
    },
    /// There is not enough memory.
    #[error(
        "shared memory is full: /dev/shm has not {} MB left, which a process needs to join; \
         remove what is in it, or make it larger (mount -o remount,size=…; in a container \
         --shm-size)",
        MEMORY >> 20
    )]
    Full(#[source] io::Error),
    /// There are not enough descriptors.
    #[error(
        "there are no file descriptors left: shared memory needs up to {DESCRIPTORS} more in this \
         process; allow it more with 'ulimit -n'"
    )]
    NoDescriptors(#[source] io::Error),
    /// The system refused to create or read a file.
    #[error("shared memory, {}: {source}", path.display())]
    Io {
        /// The file or its directory.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// iceoryx2 failed for a reason that should not occur.
    #[error("shared memory, {what}: {source:?}")]
    Iceoryx2 {
        /// What was attempted.
        what: String,
        /// The reason, in iceoryx2's words.
        source: Box<dyn Error + Send + Sync>,
    },
}

impl From<SharedMemoryError> for BusError {
    fn from(error: SharedMemoryError) -> Self {
        let is_bad_input = error.is_bad_input();
        Self::of(error, is_bad_input)
    }
}

impl SharedMemoryError {
    /// Whether the user's input is to blame.
    fn is_bad_input(&self) -> bool {
        matches!(
            self,
            Self::ForeignDirectory(_)
                | Self::OtherVersion { .. }
                | Self::SecondPlant { .. }
                | Self::TooManyWriters { .. }
                | Self::TooManyMembers { .. }
                | Self::OfferTooLong { .. }
        )
    }

    /// Names the shortage behind an error of the system's.
    pub(super) fn io(path: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |source| match source.raw_os_error().map(Errno::from_raw) {
            Some(Errno::ENOSPC | Errno::ENOMEM | Errno::EDQUOT) => Self::Full(source),
            Some(Errno::EMFILE | Errno::ENFILE) => Self::NoDescriptors(source),
            _ => Self::Io { path: path.to_owned(), source },
        }
    }

    /// Names the shortage behind an error of iceoryx2's, or else the error.
    pub(super) fn diagnose(
        root: &Path,
        what: &str,
        source: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Self {
        match resources::check(root) {
            Err(shortage) => Self::io(root)(shortage),
            Ok(()) => Self::Iceoryx2 { what: what.to_owned(), source: source.into() },
        }
    }
}

/// Wraps an error of iceoryx2's that should not occur.
pub(super) fn failure<E: Error + Send + Sync + 'static>(what: &str) -> impl FnOnce(E) -> BusError {
    move |error| {
        let error = SharedMemoryError::Iceoryx2 { what: what.to_owned(), source: Box::new(error) };
        error.into()
    }
}

/// Whether to try again after an attempt that failed.
pub(super) enum AttemptError {
    /// Another attempt would fail too.
    Permanent(SharedMemoryError),
    /// The cleanup after a crashed process may make room.
    Transient(SharedMemoryError),
}

/// Why a service of a session could not be opened.
pub(super) enum ServiceError {
    /// Other processes have created the service with another layout or configuration.
    Incompatible,
    /// There is no room for another writer.
    TooManyWriters,
    /// There is no room for another process.
    TooManyMembers,
    /// The system refused.
    System(io::Error),
    /// Another error of iceoryx2's.
    Other(Box<dyn Error + Send + Sync>),
}

impl ServiceError {
    /// The error of an attempt to open a topic of a session.
    pub(super) fn at(self, topic: &str, session: &str, root: &Path) -> AttemptError {
        let (session, name) = (session.to_owned(), topic.to_owned());
        match self {
            Self::Incompatible => {
                AttemptError::Permanent(SharedMemoryError::OtherVersion { session })
            }
            // Only plants write states.
            Self::TooManyWriters if topic == StateSample::TOPIC => {
                AttemptError::Transient(SharedMemoryError::SecondPlant { session })
            }
            Self::TooManyWriters => {
                AttemptError::Transient(SharedMemoryError::TooManyWriters { session, topic: name })
            }
            Self::TooManyMembers => {
                AttemptError::Transient(SharedMemoryError::TooManyMembers { session, topic: name })
            }
            Self::System(error) => AttemptError::Permanent(SharedMemoryError::io(root)(error)),
            Self::Other(error) => {
                AttemptError::Transient(SharedMemoryError::diagnose(root, topic, error))
            }
        }
    }

    fn other(error: impl Error + Send + Sync + 'static) -> Self {
        Self::Other(Box::new(error))
    }
}

impl From<PublishSubscribeOpenOrCreateError> for ServiceError {
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
                | E::VersionMismatch => Self::Incompatible,
                E::ExceedsMaxNumberOfNodes => Self::TooManyMembers,
                open => Self::other(open),
            },
            error => Self::other(error),
        }
    }
}

impl From<EventOpenOrCreateError> for ServiceError {
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
                | E::VersionMismatch => Self::Incompatible,
                E::ExceedsMaxNumberOfNodes => Self::TooManyMembers,
                open => Self::other(open),
            },
            error => Self::other(error),
        }
    }
}

impl From<PublisherCreateError> for ServiceError {
    fn from(error: PublisherCreateError) -> Self {
        match error {
            PublisherCreateError::ExceedsMaxSupportedPublishers => Self::TooManyWriters,
            error => Self::other(error),
        }
    }
}

impl From<SubscriberCreateError> for ServiceError {
    fn from(error: SubscriberCreateError) -> Self {
        match error {
            SubscriberCreateError::ExceedsMaxSupportedSubscribers => Self::TooManyMembers,
            error => Self::other(error),
        }
    }
}

impl From<NotifierCreateError> for ServiceError {
    fn from(error: NotifierCreateError) -> Self {
        match error {
            NotifierCreateError::ExceedsMaxSupportedNotifiers => Self::TooManyMembers,
            error => Self::other(error),
        }
    }
}

impl From<ListenerCreateError> for ServiceError {
    fn from(error: ListenerCreateError) -> Self {
        match error {
            ListenerCreateError::ExceedsMaxSupportedListeners => Self::TooManyMembers,
            error => Self::other(error),
        }
    }
}

macro_rules! other_errors {
    ($($error:ident),*) => {
        $(impl From<$error> for ServiceError {
            fn from(error: $error) -> Self {
                Self::other(error)
            }
        })*
    };
}

other_errors! {
    ServiceNameError, BlackboardCreateError, BlackboardOpenError, WriterCreateError,
    EntryHandleMutError, ReaderCreateError, EntryHandleError
}

impl From<io::Error> for ServiceError {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}
