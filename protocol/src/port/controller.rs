//! A controller's end of the bus.

use std::time::{Duration, Instant};

use mtj_model::scenario::Wait;

use super::{Offered, Rejections, offer::Follower, presence::Presence};
use crate::{
    admission::{Admission, AdmissionFilter, Rejection},
    bus::{self, Bus, BusError, Depth, Reader, Writer},
    debug_by_name,
    member::Member,
    realtime,
    sample::{ErrorSample, Header, StateSample, TorqueSample},
};

/// How many states in a row may be older than the newest. No network reorders more; so the newest
/// was not the plant's, but damaged on its way.
const STALE: u32 = 10;
/// How long the plant must be silent before states of another run count: a plant that was restarted
/// sends nothing more under its old run, and beside a living plant other runs are not for us.
const QUIET: Duration = Duration::from_millis(20);

/// What a controller has to do about the [current state](ControllerPort::state).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A new state: answer it.
    New,
    /// The state that was answered already: send that answer again.
    Repeated,
    /// A state of another run, while the plant of our run is silent: it may have been restarted.
    OtherRun,
    /// Our plant's states are older than one that was not the plant's: begin anew.
    Misled,
}

/// A controller's end: reads states, writes torques and errors.
pub struct ControllerPort {
    states: Box<dyn Reader<StateSample>>,
    torques: Box<dyn Writer<TorqueSample>>,
    errors: Box<dyn Writer<ErrorSample>>,
    presence: Presence,
    /// The current state, if the reader has advanced beyond it to states that do not count.
    kept: Option<StateSample>,
    newest: Option<Header>,
    /// When a state of our run was handled last.
    handled: Instant,
    scenario: Follower,
    wait: Wait,
    filter: AdmissionFilter,
    stale: u32,
    rejections: Rejections,
    id: u64,
}

debug_by_name!(ControllerPort);

impl ControllerPort {
    /// Joins a bus for one run of the plant, as `member`.
    pub fn open(
        bus: &impl Bus,
        member: &Member,
        offered: &Offered,
        wait: Wait,
    ) -> Result<Self, BusError> {
        let wait = realtime::affordable(wait);
        Ok(Self {
            states: bus.reader(Depth::Recent, wait)?,
            torques: bus.writer()?,
            errors: bus.writer()?,
            presence: Presence::open(bus, member)?,
            kept: None,
            newest: None,
            handled: Instant::now(),
            wait,
            filter: AdmissionFilter::new(offered.run).for_scenario(&offered.scenario),
            stale: 0,
            scenario: Follower::with(offered),
            rejections: Rejections::default(),
            id: member.id,
        })
    }

    /// Advances to the newest acceptable state; waits for one until `until`.
    pub fn receive(&mut self, until: Instant) -> Result<Option<Received>, BusError> {
        while bus::receive(&mut *self.states, self.wait, until)? {
            self.kept = None;
            let mut received = self.admit();
            // At most as many as can wait: a faster writer must not hold us for ever.
            for _ in 0..bus::RECENT_DEPTH {
                if !self.states.has_more() {
                    break;
                }
                let before = *self.state();
                if !self.states.advance()? {
                    break;
                }
                received = match (self.admit(), received) {
                    // A state of another run does not count beside one of our plant's.
                    (None | Some(Received::OtherRun), Some(received)) => {
                        self.kept = Some(before);
                        Some(received)
                    }
                    (newer, received) => {
                        self.kept = None;
                        // A state that was not answered is not repeated.
                        let is_unanswered =
                            (newer, received) == (Some(Received::Repeated), Some(Received::New));
                        if is_unanswered { received } else { newer }
                    }
                };
            }
            match received {
                None if Instant::now() >= until => break,
                None => {}
                received => return Ok(received),
            }
        }
        // A controller stays present while its plant pauses.
        if let Some(header) = self.newest {
            self.presence.publish(&header)?;
        }
        Ok(None)
    }

    fn admit(&mut self) -> Option<Received> {
        let state = self.states.sample();
        match self.filter.admit(state) {
            Admission::Fresh => {
                self.newest = Some(state.header);
                self.stale = 0;
                Some(Received::New)
            }
            Admission::Repeated => Some(Received::Repeated),
            Admission::Rejected(Rejection::Run) if self.handled.elapsed() > QUIET => {
                Some(Received::OtherRun)
            }
            Admission::Rejected(rejection) => {
                self.rejections.warn::<StateSample>(rejection);
                self.stale += u32::from(rejection == Rejection::Stale);
                (self.stale > STALE).then_some(Received::Misled)
            }
        }
    }

    /// The current state: the one that was received last.
    pub fn state(&self) -> &StateSample {
        self.kept.as_ref().unwrap_or_else(|| self.states.sample())
    }

    /// Returns the scenario of the current state, if it is newer than the one that we have. If it
    /// cannot be fetched now, a later call tries again.
    pub fn newer_scenario(&mut self, bus: &impl Bus) -> Result<Option<Offered>, BusError> {
        let header = self.state().header;
        self.scenario.follow(bus, &header)
    }

    /// Whether we lead, and so must answer the current state; otherwise we stand by.
    pub fn is_leader(&self) -> bool {
        self.state().leader() == Some(self.id)
    }

    /// Sends the answer to a state; fills in our number.
    pub fn send(&mut self, torque: &mut TorqueSample) -> Result<(), BusError> {
        torque.controller = self.id;
        self.torques.expedite(torque)
    }

    /// Publishes the tracking error as the law saw it. Off the critical path: after [`Self::send`].
    pub fn publish(&mut self, error: &ErrorSample) -> Result<(), BusError> {
        self.errors.write(error)
    }

    /// Publishes the torque to all readers, and our presence. Off the critical path too; call it
    /// after each state.
    pub fn flush(&mut self) -> Result<(), BusError> {
        // Here rather than on reception: to read a clock takes a good part of what a law takes.
        self.handled = Instant::now();
        self.torques.flush()?;
        self.states.follow()?;
        let header = self.state().header;
        self.presence.publish(&header)
    }

    /// How many state samples were not acceptable.
    pub fn rejected(&self) -> u64 {
        self.filter.rejected() + self.states.malformed()
    }
}
