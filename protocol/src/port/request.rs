//! An operator's end of the bus: requests to change a running loop.

use std::time::{Duration, Instant, SystemTime};

use mtj_model::scenario::Wait;

use crate::{
    admission,
    bus::{self, Bus, BusError, Depth, Reader, Writer},
    debug_by_name,
    request::Request,
    sample::{ChangeSample, RequestSample},
};

/// How long to wait before a request is repeated: a bus may lose one, and a plant that receives one
/// twice answers it twice and carries it out once.
pub const REPEAT: Duration = Duration::from_millis(100);

/// The plant did not answer a request. Zenoh silently drops requests from clients without
/// permission.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the plant does not answer; where it is reached with certificates, only an operator may turn \
     knobs (--identity operator)"
)]
pub struct Unanswered;

/// An operator's end: writes requests, reads the plant's answers.
pub struct RequestPort {
    requests: Box<dyn Writer<RequestSample>>,
    changes: Box<dyn Reader<ChangeSample>>,
    number: u64,
}

debug_by_name!(RequestPort);

impl RequestPort {
    /// Joins a bus.
    pub fn open(bus: &impl Bus) -> Result<Self, BusError> {
        // Numbers that no other operator uses: the time in ns since 1970, counted on from there.
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        Ok(Self {
            requests: bus.writer()?,
            changes: bus.reader(Depth::Stream, Wait::Block)?,
            number: now.as_nanos() as u64,
        })
    }

    /// The sample of a request to the plant of `run`, with a number that was not used before.
    pub fn number(&mut self, run: u64, request: &Request) -> RequestSample {
        self.number += 1;
        request.to_sample(run, self.number)
    }

    /// Sends a request; repeat it until a change answers it.
    pub fn send(&mut self, request: &RequestSample) -> Result<(), BusError> {
        self.requests.write(request)
    }

    /// Sends a request, and waits for the answer until `until`.
    pub fn ask(
        &mut self,
        run: u64,
        request: &Request,
        until: Instant,
    ) -> Result<Option<ChangeSample>, BusError> {
        let request = self.number(run, request);
        while Instant::now() < until {
            self.send(&request)?;
            let again = (Instant::now() + REPEAT).min(until);
            while bus::receive(&mut *self.changes, Wait::Block, again)? {
                let change = self.changes.sample();
                let is_answer = change.request == request.header.sequence;
                if is_answer && admission::check(change).is_ok() {
                    return Ok(Some(*change));
                }
            }
        }
        Ok(None)
    }
}
