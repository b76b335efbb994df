//! A controller's end of the bus.

use std::time::Instant;

use mtj_model::scenario::Wait;

use super::{Complaints, Offered, offer::Follower, presence::Presence};
use crate::{
    bus::{self, Bus, BusError, Depth, Reader, Writer},
    gate::{Fault, Gate, Verdict},
    member::Member,
    sample::{ErrorSample, Header, StateSample, TorqueSample},
};

/// How many states in a row may be older than the newest. No network reorders so many; the newest was
/// none of the plant's, but damaged on its way.
const STALE: u32 = 10;

/// What a controller hears.
pub enum Heard {
    /// A state to answer.
    State(StateSample),
    /// The state it has answered already, once more: the plant wants that answer again.
    Again(StateSample),
    /// A state of a plant with another scenario than the one it has, or one that does not fit what was
    /// heard before: time to begin anew.
    OtherRun(u64),
}

/// A controller's end: reads states, writes torques and errors.
pub struct ControllerPort {
    states: Box<dyn Reader<StateSample>>,
    torques: Box<dyn Writer<TorqueSample>>,
    errors: Box<dyn Writer<ErrorSample>>,
    presence: Presence,
    newest: Option<Header>,
    scenario: Follower,
    wait: Wait,
    gate: Gate,
    stale: u32,
    complaints: Complaints,
    id: u64,
}

impl ControllerPort {
    /// Joins a bus for one run of the plant, as `member`.
    pub fn open(
        bus: &impl Bus,
        member: &Member,
        offered: &Offered,
        wait: Wait,
    ) -> Result<Self, BusError> {
        Ok(Self {
            states: bus.reader(Depth::Latest, wait)?,
            torques: bus.writer()?,
            errors: bus.writer()?,
            presence: Presence::open(bus, member)?,
            newest: None,
            wait,
            gate: Gate::new(offered.run),
            stale: 0,
            scenario: Follower::knowing(offered),
            complaints: Complaints::default(),
            id: member.id,
        })
    }

    /// The next acceptable state, waiting for it until `until`.
    pub fn receive(&mut self, until: Instant) -> Result<Option<Heard>, BusError> {
        while let Some(state) = bus::receive(&mut *self.states, self.wait, until)? {
            match self.gate.judge(&state) {
                Verdict::Fresh => {
                    self.stale = 0;
                    self.newest = Some(state.header);
                    return Ok(Some(Heard::State(state)));
                }
                Verdict::Repeated => return Ok(Some(Heard::Again(state))),
                Verdict::Refused(Fault::Run) => return Ok(Some(Heard::OtherRun(state.header.run))),
                Verdict::Refused(fault) => {
                    self.complaints.once::<StateSample>(fault);
                    self.stale += u32::from(fault == Fault::Stale);
                    if self.stale > STALE {
                        return Ok(Some(Heard::OtherRun(state.header.run)));
                    }
                }
            }
        }
        // A plant that pauses is no reason to be taken for dead.
        if let Some(header) = self.newest {
            self.presence.tell(&header)?;
        }
        Ok(None)
    }

    /// The scenario, if it was changed before `state` was measured and we have not got it yet. If it
    /// cannot be had now, it will be asked for again a little later.
    pub fn newer_scenario(
        &mut self,
        bus: &impl Bus,
        state: &StateSample,
    ) -> Result<Option<Offered>, BusError> {
        self.scenario.follow(bus, &state.header)
    }

    /// Whether we are to answer a state, rather than another controller we stand by for.
    pub fn is_in_charge(&self, state: &StateSample) -> bool {
        state.leader == self.id
    }

    /// Answers a state.
    pub fn send(&mut self, torque: &TorqueSample) -> Result<(), BusError> {
        self.torques.write(&TorqueSample { controller: self.id, ..*torque })
    }

    /// Tells monitors how the law saw the instant. Off the critical path: after [`Self::send`].
    pub fn publish(&mut self, error: &ErrorSample) -> Result<(), BusError> {
        self.errors.write(error)
    }

    /// Tells everybody that we are there. Off the critical path too; to be called often.
    pub fn tell(&mut self, state: &StateSample) -> Result<(), BusError> {
        self.presence.tell(&state.header)
    }

    /// State samples that were not acceptable, so far.
    pub fn rejected(&self) -> u64 {
        self.gate.refused() + self.states.malformed()
    }
}
