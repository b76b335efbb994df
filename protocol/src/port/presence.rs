//! Who takes part.

use std::time::{Duration, Instant, SystemTime};

use crate::{
    bus::{Bus, BusError, Writer},
    sample::{Header, PresenceSample, text},
};

/// How often a role says that it is there.
const PERIOD: Duration = Duration::from_secs(1);

/// Which role says so.
#[derive(Clone, Copy)]
pub enum RoleName {
    /// 0 on the wire.
    Plant,
    /// 1 on the wire.
    Controller,
}

/// Says once a second that a role takes part, since when and where.
pub struct Presence {
    writer: Box<dyn Writer<PresenceSample>>,
    sample: PresenceSample,
    next: Instant,
}

impl Presence {
    pub fn open(bus: &impl Bus, role: RoleName) -> Result<Self, BusError> {
        let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let host = nix::unistd::gethostname().unwrap_or_default();
        let sample = PresenceSample {
            header: Header::default(),
            role: role as u64,
            process: u64::from(std::process::id()),
            since_ns: since.as_nanos() as u64,
            host: text(&host.to_string_lossy()),
        };
        Ok(Self { writer: bus.writer()?, sample, next: Instant::now() })
    }

    /// To be called often; `header` is of the instant the role last dealt with.
    pub fn tell(&mut self, header: &Header) -> Result<(), BusError> {
        if Instant::now() < self.next {
            return Ok(());
        }
        self.next = Instant::now() + PERIOD;
        self.writer.write(&PresenceSample { header: header.answer(), ..self.sample })
    }
}
