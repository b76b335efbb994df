//! The presence of a role in a session.

use std::{
    any::Any,
    time::{Duration, Instant},
};

use crate::{
    bus::{Bus, BusError, Writer},
    member::Member,
    sample::{Header, PresenceSample, text},
};

/// How often a role publishes its presence.
const PERIOD: Duration = Duration::from_secs(1);

/// A member's announcement on the bus, and the presence sample that tells monitors its process and
/// machine.
pub(super) struct Presence {
    writer: Box<dyn Writer<PresenceSample>>,
    sample: PresenceSample,
    next: Instant,
    _announcement: Box<dyn Any>,
}

impl Presence {
    /// Announces a member.
    pub(super) fn open(bus: &impl Bus, member: &Member) -> Result<Self, BusError> {
        let host = nix::unistd::gethostname().unwrap_or_default();
        let sample = PresenceSample {
            header: Header::default(),
            role: member.role as u64,
            process: u64::from(std::process::id()),
            since_ns: member.since_ns,
            id: member.id,
            precedence: u64::from(member.precedence),
            host: text(&host.to_string_lossy()),
        };
        Ok(Self {
            _announcement: bus.announce(member)?,
            writer: bus.writer()?,
            sample,
            next: Instant::now(),
        })
    }

    /// Publishes the presence if a period is over; `header` is of the instant that the role handled
    /// last.
    pub(super) fn publish(&mut self, header: &Header) -> Result<(), BusError> {
        if Instant::now() < self.next {
            return Ok(());
        }
        self.next = Instant::now() + PERIOD;
        self.writer.write(&PresenceSample { header: header.answer(), ..self.sample })
    }
}
