//! The port of an operator that changes a running loop.

use std::time::{Duration, Instant, SystemTime};

use mtj_model::scenario::Wait;

use crate::{
    bus::{self, Bus, BusError, Depth, Reader, Writer},
    gate,
    knob::Knob,
    sample::{ChangeSample, RequestSample},
};

/// How long to wait before asking once more: a bus may lose a request, and a plant that gets one twice
/// answers it twice and carries it out once.
pub const REPEAT: Duration = Duration::from_millis(100);

/// What to say when no answer came. Zenoh silently drops requests from clients without permission.
pub const UNANSWERED: &str = "the plant does not answer; where it is reached with certificates, only an operator may \
                              turn knobs (--identity operator)";

/// Asks the plant to turn knobs.
pub struct RequestPort {
    requests: Box<dyn Writer<RequestSample>>,
    changes: Box<dyn Reader<ChangeSample>>,
    next: u64,
}

impl RequestPort {
    /// Joins a bus to ask.
    pub fn open(bus: &impl Bus) -> Result<Self, BusError> {
        // Numbers that no other asker uses: the time in ns since 1970, counted on from there.
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        Ok(Self {
            requests: bus.writer()?,
            changes: bus.reader(Depth::Stream, Wait::Block)?,
            next: now.as_nanos() as u64,
        })
    }

    /// Names a request to the plant of `run`.
    pub fn prepare(&mut self, run: u64, knob: &Knob) -> RequestSample {
        self.next += 1;
        knob.request(run, self.next)
    }

    /// Sends a request; to be repeated until a change answers it.
    pub fn send(&mut self, request: &RequestSample) -> Result<(), BusError> {
        self.requests.write(request)
    }

    /// Asks, and waits for the answer until `until`.
    pub fn turn(
        &mut self,
        run: u64,
        knob: &Knob,
        until: Instant,
    ) -> Result<Option<ChangeSample>, BusError> {
        let request = self.prepare(run, knob);
        while Instant::now() < until {
            self.send(&request)?;
            let again = (Instant::now() + REPEAT).min(until);
            while bus::receive(&mut *self.changes, Wait::Block, again)? {
                let change = self.changes.sample();
                if gate::fault(change).is_none() && change.request == request.header.sequence {
                    return Ok(Some(*change));
                }
            }
        }
        Ok(None)
    }
}
