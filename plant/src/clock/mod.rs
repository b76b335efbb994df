//! Clocks: how a run waits for an event, and for the answer to a state.

mod lockstep;
mod realtime;

use std::time::Duration;

use mtj_protocol::{bus::BusError, sample::StateSample};

pub(crate) use self::{lockstep::Lockstep, realtime::Realtime};
use crate::{peer::Peer, sequencer::Sequencer};

/// What came while a clock waited.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// Nothing that acts on the arm.
    Nothing,
    /// A torque, which sets out for the arm at this instant, ns.
    Torque(u64),
    /// The run is to stop.
    Stop,
}

/// The times for which the plant did not run, because it was stopped or its machine was: the run's
/// time stood still meanwhile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Stalls {
    /// How many there were.
    pub(crate) count: u64,
    /// The longest, ns.
    pub(crate) longest_ns: u64,
}

/// A clock. Times are ns since the run began.
pub(crate) trait Clock {
    /// A clock of a run that has not begun.
    fn new() -> Self;
    /// The run begins.
    fn start(&mut self);
    /// Waits until `time_ns`, or until something comes before.
    fn wait(
        &mut self,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
        time_ns: u64,
    ) -> Result<Heard, BusError>;
    /// Hands a state over at `time_ns`.
    fn hand_over(
        &mut self,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
        state: &mut StateSample,
        time_ns: u64,
    ) -> Result<Heard, BusError>;
    /// Waits for so long while the run stands still at `time_ns`.
    fn stand_still(
        &mut self,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
        time_ns: u64,
        patience: Duration,
    ) -> Result<Heard, BusError>;
    /// Whether the run's time stands still while the plant waits for something, however long that
    /// takes.
    fn stands_still(&self) -> bool;
    /// The run goes on after it stood still for so long.
    fn resume(&mut self, _stood_still: Duration) {}
    /// A sample is about to be taken that was due at `time_ns`.
    fn sample(&mut self, _time_ns: u64, _period_ns: u64) {}
    /// A command came into effect.
    fn apply(&mut self, _time_ns: u64) {}
    /// The run ended at `time_ns`.
    fn end(&mut self, _peer: &Peer<'_>, _sequencer: &mut Sequencer, _time_ns: u64) {}
    /// How many sampling instants were reached only after the next was due; `None` where that
    /// cannot be.
    fn deadline_misses(&self) -> Option<u64> {
        None
    }
    /// The times for which the plant did not run.
    fn stalls(&self) -> Stalls {
        Stalls::default()
    }
    /// The longest time without a fresh command, ns; `None` where it says nothing.
    fn longest_gap_ns(&self) -> Option<u64> {
        None
    }
}
