//! The bus: the trait that every transport implements.
//!
//! A bus moves samples of a topic from writers to readers, and a scenario from a plant to any
//! process that asks. It knows nothing of control: [`crate::port`] decides which topics a role may
//! write, [`crate::admission`] which samples are acceptable.
//!
//! # A bus of your own
//!
//! A transport implements [`Bus`] and returns its own [`Writer`], [`Reader`], [`Offering`] and
//! [`Attendance`]. A *middleware* wraps any bus and is one; it replaces what it changes and passes
//! on the rest. This one counts the samples that its writers send:
//!
//! ```
//! use std::{
//!     any::Any,
//!     sync::{
//!         Arc,
//!         atomic::{AtomicU64, Ordering},
//!     },
//! };
//!
//! use mtj_model::scenario::Wait;
//! use mtj_protocol::{
//!     bus::{Attendance, Bus, BusError, Depth, Offering, Reader, Writer},
//!     local::LocalBus,
//!     member::Member,
//!     sample::{Sample, StateSample},
//! };
//!
//! struct Tap<B> {
//!     bus: B,
//!     sent: Arc<AtomicU64>,
//! }
//!
//! struct TapWriter<S> {
//!     writer: Box<dyn Writer<S>>,
//!     sent: Arc<AtomicU64>,
//! }
//!
//! impl<S: Sample> Writer<S> for TapWriter<S> {
//!     fn write(&mut self, sample: &S) -> Result<(), BusError> {
//!         self.sent.fetch_add(1, Ordering::Relaxed);
//!         self.writer.write(sample)
//!     }
//!     fn expedite(&mut self, sample: &S) -> Result<(), BusError> {
//!         self.sent.fetch_add(1, Ordering::Relaxed);
//!         self.writer.expedite(sample)
//!     }
//!     fn flush(&mut self) -> Result<(), BusError> {
//!         self.writer.flush()
//!     }
//! }
//!
//! impl<B: Bus> Bus for Tap<B> {
//!     fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
//!         Ok(Box::new(TapWriter { writer: self.bus.writer()?, sent: Arc::clone(&self.sent) }))
//!     }
//!     fn reader<S: Sample>(
//!         &self,
//!         depth: Depth,
//!         wait: Wait,
//!     ) -> Result<Box<dyn Reader<S>>, BusError> {
//!         self.bus.reader(depth, wait)
//!     }
//!     fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
//!         self.bus.offer(bytes)
//!     }
//!     fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
//!         self.bus.fetch()
//!     }
//!     fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
//!         self.bus.announce(member)
//!     }
//!     fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
//!         self.bus.attendance()
//!     }
//! }
//!
//! let tap = Tap { bus: LocalBus::default(), sent: Arc::default() };
//! let mut reader = tap.reader::<StateSample>(Depth::Stream, Wait::Block)?;
//! let mut writer = tap.writer::<StateSample>()?;
//! writer.write(&StateSample::default())?;
//! assert_eq!(reader.take()?, Some(StateSample::default()));
//! assert_eq!(tap.sent.load(Ordering::Relaxed), 1);
//! # Ok::<(), BusError>(())
//! ```
//!
//! The crate `mtj-conformance` (`protocol/conformance`) tests any bus against the rules that the
//! ports rely on.

use std::{any::Any, collections::BTreeSet, error::Error, time::Instant};

use mtj_model::scenario::{ScenarioError, Wait};
use nix::errno::Errno;

use crate::{member::Member, sample::Sample};

/// A transport of samples.
pub trait Bus {
    /// Opens a writer of one topic.
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError>;
    /// Opens a reader of one topic.
    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError>;
    /// Offers bytes (an encoded scenario) to [`Bus::fetch`] until the result is dropped.
    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError>;
    /// Returns the bytes on offer now, if any.
    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError>;
    /// Announces a member of the session until the result is dropped or its process dies.
    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError>;
    /// Watches which members of the session are present.
    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError>;
    /// Why a session may seem to be empty, in a sentence for the user who waits for a plant; `None`
    /// if the bus knows no reason.
    fn reason_for_silence(&self) -> Option<String> {
        None
    }
}

/// The members of a session that are present.
pub trait Attendance {
    /// All announced members that live, as far as the bus knows. May take a fraction of a
    /// millisecond.
    fn present(&mut self) -> Result<Vec<Member>, BusError>;
    /// Whether a member that was present still is. Takes some microseconds at most.
    fn is_present(&mut self, member: &Member) -> Result<bool, BusError>;
}

/// A bus that many sessions share.
pub trait Shared: Bus + Sized {
    /// The same bus, for another session.
    fn within(&self, session: &str) -> Result<Self, BusError>;
    /// Watches which sessions there are.
    fn sessions(&self) -> Result<Box<dyn Sessions>, BusError>;
}

/// The sessions of a bus.
pub trait Sessions {
    /// The names of all sessions with an announced member, as far as the bus knows.
    fn names(&mut self) -> Result<BTreeSet<String>, BusError>;
}

/// How many samples a reader keeps until its owner takes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// The newest [`RECENT_DEPTH`] samples, as promptly as the bus can deliver them: for the loop,
    /// which takes the newest acceptable sample and drops the others.
    Recent,
    /// Every sample in order, if the reader is emptied within [`STREAM_DEPTH`] samples.
    Stream,
}

/// How many samples [`Depth::Recent`] keeps.
pub const RECENT_DEPTH: usize = 1024;

/// How many samples [`Depth::Stream`] keeps.
pub const STREAM_DEPTH: usize = 4096;

/// The writing end of a topic.
pub trait Writer<S> {
    /// Makes a sample visible to all readers. Never blocks.
    fn write(&mut self, sample: &S) -> Result<(), BusError>;
    /// Makes a sample visible at once to the readers that [`Reader::follow`] this writer. The
    /// others see it after the next [`Writer::flush`] or the next sample. By default the same as
    /// [`Writer::write`].
    fn expedite(&mut self, sample: &S) -> Result<(), BusError> {
        self.write(sample)
    }
    /// Makes the expedited sample visible to all readers.
    fn flush(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// The reading end of a topic.
///
/// It advances from sample to sample and lends the current one: to move some hundred bytes from
/// call to call takes as long as the work on them.
pub trait Reader<S> {
    /// Advances to the next sample; returns whether there was one.
    fn advance(&mut self) -> Result<bool, BusError>;
    /// The current sample.
    fn sample(&self) -> &S;
    /// Advances to the next sample and returns a copy of it.
    fn take(&mut self) -> Result<Option<S>, BusError>
    where
        S: Copy,
    {
        Ok(if self.advance()? { Some(*self.sample()) } else { None })
    }
    /// Sleeps until there may be a sample, or until `until`.
    fn sleep(&mut self, until: Instant) -> Result<(), BusError>;
    /// Polls for a microsecond or so and advances to the next sample, if one came. One call need
    /// not look in every place where a sample can arrive. Yields the core if the transport's own
    /// threads need it.
    fn spin(&mut self) -> Result<bool, BusError>;
    /// Prefers from now on what the writer of the current sample [expedites](Writer::expedite), of
    /// which only the newest is kept. May take a millisecond when the writer is another one than
    /// before.
    fn follow(&mut self) -> Result<(), BusError> {
        Ok(())
    }
    /// Whether expedited samples arrive from the writer that is followed.
    fn follows(&self) -> bool {
        false
    }
    /// Whether there is another sample already.
    fn has_more(&self) -> bool;
    /// How many messages on the topic were no samples.
    fn malformed(&self) -> u64;
}

/// The offering end of a scenario.
pub trait Offering {
    /// Replaces the bytes on offer.
    fn renew(&mut self, bytes: Vec<u8>) -> Result<(), BusError>;
    /// Delivers the offer to processes that have joined since. Cheap; call it a few times a second.
    fn serve(&mut self) -> Result<(), BusError>;
}

/// Advances to the next sample; waits for it until `until`, in the given manner.
pub fn receive<S>(
    reader: &mut dyn Reader<S>,
    wait: Wait,
    until: Instant,
) -> Result<bool, BusError> {
    let mut sleep_from = None;
    loop {
        let found = match wait {
            Wait::Block => reader.advance()?,
            Wait::Spin | Wait::Hybrid(_) => reader.spin()?,
        };
        if found {
            return Ok(true);
        }
        let now = Instant::now();
        if now >= until {
            // A reader that spins may not have looked everywhere.
            return reader.advance();
        }
        match wait {
            Wait::Spin => {}
            Wait::Hybrid(spin) if now < *sleep_from.get_or_insert(now + spin) => {}
            Wait::Block | Wait::Hybrid(_) => reader.sleep(until)?,
        }
    }
}

/// Why a bus, or a role on it, cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// Several processes are to use the bus within one process.
    #[error(
        "bus.kind = \"local\" stays within one process; roles of their own need iceoryx2 or zenoh"
    )]
    LocalToProcess,
    /// Many sessions are to use the bus that has one.
    #[error("bus.kind = \"local\" has one session; many need iceoryx2 or zenoh")]
    OneSession,
    /// The transport was left out when the program was built.
    #[error("this program was built without {transport}")]
    NotBuilt {
        /// Its name in scenarios.
        transport: &'static str,
    },
    /// The processor of `--cpu` cannot be had.
    #[error(
        "--cpu {core}: {}; this process may use {allowed} of this machine's processors, counted \
         from 0",
        source.desc()
    )]
    Cpu {
        /// The processor that was asked for.
        core: usize,
        /// How many the process may use.
        allowed: usize,
        /// The system's reason.
        source: Errno,
    },
    /// The session has a plant.
    #[error(
        "session '{session}' has a plant already; stop it, or choose another name with --session"
    )]
    SecondPlant {
        /// The session.
        session: String,
    },
    /// The settings of the bus are not valid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// Bad input of a transport, or of a role on it: an address in use, a file that is not there.
    #[error(transparent)]
    Settings(Box<dyn Error + Send + Sync>),
    /// A transport, or the surroundings of a role on it, failed.
    #[error(transparent)]
    Transport(Box<dyn Error + Send + Sync>),
    /// The controller could not answer.
    #[error(transparent)]
    Controller(Box<dyn Error + Send + Sync>),
}

impl BusError {
    /// The error of a transport, as bad input or as a failure.
    pub fn of(error: impl Into<Box<dyn Error + Send + Sync>>, is_bad_input: bool) -> Self {
        if is_bad_input { Self::Settings(error.into()) } else { Self::Transport(error.into()) }
    }

    /// Whether the user's input is to blame: exit status 2 rather than 1.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::LocalToProcess
            | Self::OneSession
            | Self::NotBuilt { .. }
            | Self::Cpu { .. }
            | Self::SecondPlant { .. }
            | Self::Scenario(_)
            | Self::Settings(_) => true,
            Self::Transport(_) | Self::Controller(_) => false,
        }
    }
}
