//! A controller's end of the bus.

use std::time::{Duration, Instant};

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
/// How long our own plant must be quiet before another run counts: a plant that was restarted says nothing under
/// its old run, and what others say beside it is not for us.
const QUIET: Duration = Duration::from_millis(20);

/// What a controller hears: what there is to do about the [state at hand](ControllerPort::state).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A state to answer.
    State,
    /// The state it has answered already, once more: the plant wants that answer again.
    Again,
    /// A state of another run, when none of our own came for a while: the plant may have been restarted.
    OtherRun,
    /// States of our plant that are older than one that was none of its: time to begin anew.
    Misled,
}

/// A controller's end: reads states, writes torques and errors.
pub struct ControllerPort {
    states: Box<dyn Reader<StateSample>>,
    torques: Box<dyn Writer<TorqueSample>>,
    errors: Box<dyn Writer<ErrorSample>>,
    presence: Presence,
    /// The state at hand, if others came after it that say nothing beside it.
    kept: Option<StateSample>,
    newest: Option<Header>,
    /// When a state of our run was dealt with last.
    heard: Instant,
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
            states: bus.reader(Depth::Recent, wait)?,
            torques: bus.writer()?,
            errors: bus.writer()?,
            presence: Presence::open(bus, member)?,
            kept: None,
            newest: None,
            heard: Instant::now(),
            wait,
            gate: Gate::new(offered.run).for_scenario(&offered.scenario),
            stale: 0,
            scenario: Follower::knowing(offered),
            complaints: Complaints::default(),
            id: member.id,
        })
    }

    /// Goes on to the newest acceptable state, waiting for one until `until`.
    pub fn receive(&mut self, until: Instant) -> Result<Option<Heard>, BusError> {
        while bus::receive(&mut *self.states, self.wait, until)? {
            self.kept = None;
            let mut heard = self.judge();
            // At most as many as can wait: a faster writer must not hold us for ever.
            for _ in 0..bus::RECENT_DEPTH {
                if !self.states.has_more() {
                    break;
                }
                let before = *self.state();
                if !self.states.advance()? {
                    break;
                }
                heard = match (self.judge(), heard) {
                    // Somebody else's says nothing beside one of our plant's.
                    (None | Some(Heard::OtherRun), Some(heard)) => {
                        self.kept = Some(before);
                        Some(heard)
                    }
                    (newer, heard) => {
                        self.kept = None;
                        // What was not answered is not repeated.
                        let is_unanswered =
                            (newer, heard) == (Some(Heard::Again), Some(Heard::State));
                        if is_unanswered { heard } else { newer }
                    }
                };
            }
            match heard {
                None if Instant::now() >= until => break,
                None => {}
                heard => return Ok(heard),
            }
        }
        // A plant that pauses is no reason to be taken for dead.
        if let Some(header) = self.newest {
            self.presence.tell(&header)?;
        }
        Ok(None)
    }

    fn judge(&mut self) -> Option<Heard> {
        let state = self.states.sample();
        match self.gate.judge(state) {
            Verdict::Fresh => {
                self.newest = Some(state.header);
                self.stale = 0;
                Some(Heard::State)
            }
            Verdict::Repeated => Some(Heard::Again),
            Verdict::Refused(Fault::Run) if self.heard.elapsed() > QUIET => Some(Heard::OtherRun),
            Verdict::Refused(fault) => {
                self.complaints.once::<StateSample>(fault);
                self.stale += u32::from(fault == Fault::Stale);
                (self.stale > STALE).then_some(Heard::Misled)
            }
        }
    }

    /// The state at hand: what was heard last.
    pub fn state(&self) -> &StateSample {
        self.kept.as_ref().unwrap_or_else(|| self.states.sample())
    }

    /// The scenario, if it was changed before the state at hand was measured and we have not got it yet. If it
    /// cannot be had now, it will be asked for again a little later.
    pub fn newer_scenario(&mut self, bus: &impl Bus) -> Result<Option<Offered>, BusError> {
        let header = self.state().header;
        self.scenario.follow(bus, &header)
    }

    /// Whether we are to answer the state at hand, rather than another controller we stand by for.
    pub fn is_in_charge(&self) -> bool {
        self.state().leader == self.id
    }

    /// Answers a state, with our number filled in.
    pub fn send(&mut self, torque: &mut TorqueSample) -> Result<(), BusError> {
        torque.controller = self.id;
        self.torques.expedite(torque)
    }

    /// Tells monitors how the law saw the instant. Off the critical path: after [`Self::send`].
    pub fn publish(&mut self, error: &ErrorSample) -> Result<(), BusError> {
        self.errors.write(error)
    }

    /// Tells everybody what we sent, and that we are there. Off the critical path too; to be called after
    /// each state.
    pub fn tell(&mut self) -> Result<(), BusError> {
        // Here rather than where it was heard: to read a clock takes a good part of what a law takes.
        self.heard = Instant::now();
        self.torques.settle()?;
        self.states.follow()?;
        let header = self.state().header;
        self.presence.tell(&header)
    }

    /// State samples that were not acceptable, so far.
    pub fn rejected(&self) -> u64 {
        self.gate.refused() + self.states.malformed()
    }
}
