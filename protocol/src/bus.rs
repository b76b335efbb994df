//! The bus: the trait that every transport is.
//!
//! A bus moves samples of a topic from writers to readers, and a scenario from a plant to any process
//! that asks. It knows nothing of control: which topics a role may write is decided in [`crate::port`],
//! and what is acceptable in [`crate::gate`].

use std::{any::Any, collections::BTreeSet, fmt, time::Instant};

use mtj_model::scenario::Wait;

use crate::{member::Member, sample::Sample};

/// Something that moves samples.
pub trait Bus {
    /// A writer of one topic.
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError>;
    /// A reader of one topic.
    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError>;
    /// Offers bytes (an encoded scenario) to all who [`Bus::fetch`], for as long as the result lives.
    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError>;
    /// What is on offer now, if anything.
    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError>;
    /// Makes it known that `member` takes part in the session, for as long as the result lives; if this
    /// process dies, the bus notices.
    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError>;
    /// Watches who has announced himself in the session.
    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError>;
}

/// Who takes part in a session.
pub trait Attendance {
    /// All who have announced themselves and live, as far as the bus knows. May take a fraction of a millisecond.
    fn present(&mut self) -> Result<Vec<Member>, BusError>;
    /// Whether one that was present still is. Takes some microseconds at most.
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
    /// The names of all in which somebody has announced himself, as far as the bus knows.
    fn names(&mut self) -> Result<BTreeSet<String>, BusError>;
}

/// How much a reader keeps for its owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// The newest few, as promptly as can be: what the ends of a loop want, to whom others may write whom
    /// they do not mean, and faster than they listen.
    Recent,
    /// Every sample in order, as long as the reader is emptied within [`STREAM_DEPTH`] samples.
    Stream,
}

/// How many samples [`Depth::Recent`] keeps.
pub const RECENT_DEPTH: usize = 1024;

/// How many samples a stream holds for a reader that is busy.
pub const STREAM_DEPTH: usize = 4096;

/// The writing end of a topic.
pub trait Writer<S> {
    /// Makes a sample visible to all readers. Never blocks.
    fn write(&mut self, sample: &S) -> Result<(), BusError>;
    /// Makes a sample visible to those who [`Reader::follow`] this writer, at once; to all others with the
    /// next [`Writer::settle`] or the next sample. On a bus without such a difference it is written.
    fn expedite(&mut self, sample: &S) -> Result<(), BusError> {
        self.write(sample)
    }
    /// Lets everybody have what was expedited.
    fn settle(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// The reading end of a topic: goes from sample to sample, and lends the one that is at hand, because to move samples
/// of some hundred bytes from call to call takes as long as what is done with them.
pub trait Reader<S> {
    /// Goes on to the next sample, if there is one.
    fn advance(&mut self) -> Result<bool, BusError>;
    /// The sample at hand: the one that was gone on to last.
    fn sample(&self) -> &S;
    /// The next sample, if there is one, to be kept.
    fn take(&mut self) -> Result<Option<S>, BusError>
    where
        S: Copy,
    {
        Ok(if self.advance()? { Some(*self.sample()) } else { None })
    }
    /// Sleeps until there may be a sample, or until `until`.
    fn sleep(&mut self, until: Instant) -> Result<(), BusError>;
    /// Looks for the next sample for a moment, a microsecond or so, and not everywhere every time, and goes on to it.
    /// A transport whose own threads need a core to bring it yields that.
    fn spin(&mut self) -> Result<bool, BusError>;
    /// From now on looks first for what the writer of the sample at hand has [expedited](Writer::expedite),
    /// of which only the newest counts. May take a millisecond when that writer is another one than before.
    fn follow(&mut self) -> Result<(), BusError> {
        Ok(())
    }
    /// Whether there is such a way from the writer that is followed.
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
    /// From now on offers something else.
    fn renew(&mut self, bytes: Vec<u8>) -> Result<(), BusError>;
    /// Serves those who have come since. Cheap; call it a few times a second.
    fn serve(&mut self) -> Result<(), BusError>;
}

/// Goes on to the next sample, waiting for it until `until`, in the given manner.
pub fn receive<S>(
    reader: &mut dyn Reader<S>,
    wait: Wait,
    until: Instant,
) -> Result<bool, BusError> {
    let mut tired = None;
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
            Wait::Hybrid(spin) if now < *tired.get_or_insert(now + spin) => {}
            Wait::Block | Wait::Hybrid(_) => reader.sleep(until)?,
        }
    }
}

/// What can go wrong with a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BusError {
    /// The user asked for something that cannot be: an address in use, a file that is not there.
    Settings(String),
    /// The transport failed.
    Transport(String),
    /// The controller could not answer.
    Controller(String),
}

impl fmt::Display for BusError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Settings(sentence) | Self::Transport(sentence) | Self::Controller(sentence) => {
                f.write_str(sentence)
            }
        }
    }
}

impl std::error::Error for BusError {}
