//! The controller as the plant sees it, and how long its answers take.

use std::time::{Duration, Instant};

use mtj_protocol::{
    bus::BusError,
    port::{Answer, Exchange},
    sample::{StateSample, TorqueSample},
    stall,
};

use crate::durations::Durations;

/// The controller at the other end of an exchange.
pub(crate) struct Peer<'a> {
    exchange: &'a mut dyn Exchange,
    proceed: &'a dyn Fn() -> bool,
    /// Whether round trips are measured.
    is_timed: bool,
    origin: Instant,
    round_trip_ns: u64,
    residence_ns: u64,
    /// States sent before this instant have no round trip that says anything, ns.
    forgotten_ns: u64,
    round_trips: Durations,
    residences: Durations,
}

impl<'a> Peer<'a> {
    /// A controller that is asked for as long as `proceed` says so.
    pub(crate) fn new(
        exchange: &'a mut dyn Exchange,
        proceed: &'a dyn Fn() -> bool,
        is_timed: bool,
    ) -> Self {
        Self {
            exchange,
            proceed,
            is_timed,
            origin: Instant::now(),
            round_trip_ns: 0,
            residence_ns: 0,
            forgotten_ns: 0,
            round_trips: Durations::default(),
            residences: Durations::default(),
        }
    }

    /// Sends a state, stamped.
    pub(crate) fn send(&mut self, state: &mut StateSample) -> Result<(), BusError> {
        state.sent_ns = self.now_ns();
        self.exchange.send(state)
    }

    /// Sends a state and waits for the answer to it.
    pub(crate) fn ask(
        &mut self,
        state: &mut StateSample,
        patience: Duration,
    ) -> Result<Option<Answer>, BusError> {
        if !self.is_timed {
            self.exchange.send(state)?;
            return self.exchange.receive(self.origin);
        }
        self.send(state)?;
        let until = Instant::now() + patience;
        while let Some(answer) = self.exchange.receive(until)? {
            let now = Instant::now();
            if stall::stall(until, now).is_some() {
                self.forget_round_trips();
            }
            if self.torque().header.sequence == state.header.sequence {
                if answer == Answer::Torque {
                    self.note_round_trip(now);
                }
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }

    /// Notes how long the torque took that was received last, `now`, and returns it, ns; `None` if
    /// that says nothing.
    pub(crate) fn note_round_trip(&mut self, now: Instant) -> Option<u64> {
        let TorqueSample { state_sent_ns, residence_ns, .. } = *self.exchange.torque();
        if !self.is_timed || state_sent_ns < self.forgotten_ns {
            return None;
        }
        let now_ns = now.saturating_duration_since(self.origin).as_nanos() as u64;
        self.round_trip_ns = now_ns.saturating_sub(state_sent_ns);
        // A controller cannot have taken longer than we have waited, whatever it says.
        self.residence_ns = residence_ns.min(self.round_trip_ns);
        self.round_trips.record(self.round_trip_ns);
        self.residences.record(self.residence_ns);
        Some(self.round_trip_ns)
    }

    /// Measures no round trip of a state that was sent before now, because the plant did not run for
    /// a part of it.
    pub(crate) fn forget_round_trips(&mut self) {
        self.forgotten_ns = self.now_ns();
    }

    /// Whether to go on.
    pub(crate) fn may_proceed(&self) -> bool {
        (self.proceed)()
    }

    /// The torque that was received last.
    pub(crate) fn torque(&self) -> &TorqueSample {
        self.exchange.torque()
    }

    /// The exchange itself.
    pub(crate) fn exchange(&mut self) -> &mut dyn Exchange {
        self.exchange
    }

    /// ns by the clock that stamps states.
    pub(crate) fn now_ns(&self) -> u64 {
        self.origin.elapsed().as_nanos() as u64
    }

    /// State sent to torque received, of the torque received last, ns.
    pub(crate) fn round_trip_ns(&self) -> u64 {
        self.round_trip_ns
    }

    /// The part of it spent inside the controller.
    pub(crate) fn residence_ns(&self) -> u64 {
        self.residence_ns
    }

    /// All round trips and all residence times.
    pub(crate) fn into_durations(self) -> (Durations, Durations) {
        (self.round_trips, self.residences)
    }
}
