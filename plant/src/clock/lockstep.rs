//! Lockstep: the run's time stands still while the controller computes.

use std::time::{Duration, Instant};

use mtj_protocol::{bus::BusError, port::Answer, sample::StateSample};

use super::{Clock, Heard};
use crate::{peer::Peer, sequencer::Sequencer};

/// How often to repeat a state, in case the controller was replaced.
const REPEAT: Duration = Duration::from_millis(200);

/// Time that passes from event to event; a run does not depend on wall time.
pub(crate) struct Lockstep;

impl Clock for Lockstep {
    fn new() -> Self {
        Self
    }

    fn start(&mut self) {}

    fn wait(
        &mut self,
        _peer: &mut Peer<'_>,
        _sequencer: &mut Sequencer,
        _time_ns: u64,
    ) -> Result<Heard, BusError> {
        Ok(Heard::Nothing)
    }

    /// Asks until the state is answered.
    fn hand_over(
        &mut self,
        peer: &mut Peer<'_>,
        _sequencer: &mut Sequencer,
        state: &mut StateSample,
        time_ns: u64,
    ) -> Result<Heard, BusError> {
        loop {
            match peer.ask(state, REPEAT)? {
                Some(Answer::Torque) => return Ok(Heard::Torque(time_ns)),
                Some(Answer::NotFinite) => return Ok(Heard::Nothing),
                None if !peer.may_proceed() => return Ok(Heard::Stop),
                None => {}
            }
        }
    }

    fn stands_still(&self) -> bool {
        true
    }

    fn stand_still(
        &mut self,
        peer: &mut Peer<'_>,
        _sequencer: &mut Sequencer,
        _time_ns: u64,
        patience: Duration,
    ) -> Result<Heard, BusError> {
        // Every state was answered; what comes now is a repetition.
        peer.exchange().receive(Instant::now() + patience)?;
        Ok(Heard::Nothing)
    }
}
