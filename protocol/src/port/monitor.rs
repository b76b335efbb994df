//! A monitor's end of the bus.

use std::sync::Arc;

use mtj_model::scenario::Wait;

use super::{Complaints, Offered, offer::Follower};
use crate::{
    bus::{self, Bus, BusError, Depth, Reader},
    gate,
    sample::{
        ChangeSample, ErrorSample, PresenceSample, RequestSample, Sample, StateSample,
        StatusSample, TorqueSample,
    },
};

/// Anything that is said in a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// The scenario of a run, or one that was changed; comes before the samples it is about.
    Scenario(Arc<Offered>),
    /// Plant to controller.
    State(StateSample),
    /// Controller to plant.
    Torque(TorqueSample),
    /// Controller to monitors.
    Error(ErrorSample),
    /// Plant to monitors.
    Status(StatusSample),
    /// Anybody to plant.
    Request(RequestSample),
    /// Plant to everybody.
    Change(ChangeSample),
    /// A role to everybody.
    Presence(PresenceSample),
}

/// A monitor's end: reads everything, writes nothing.
pub struct MonitorPort {
    states: Box<dyn Reader<StateSample>>,
    torques: Box<dyn Reader<TorqueSample>>,
    errors: Box<dyn Reader<ErrorSample>>,
    statuses: Box<dyn Reader<StatusSample>>,
    requests: Box<dyn Reader<RequestSample>>,
    changes: Box<dyn Reader<ChangeSample>>,
    presences: Box<dyn Reader<PresenceSample>>,
    scenario: Follower,
    complaints: Complaints,
    refused: u64,
}

impl MonitorPort {
    /// Joins a bus to listen.
    pub fn open(bus: &impl Bus) -> Result<Self, BusError> {
        let wait = Wait::Block;
        Ok(Self {
            states: bus.reader(Depth::Stream, wait)?,
            torques: bus.reader(Depth::Stream, wait)?,
            errors: bus.reader(Depth::Stream, wait)?,
            statuses: bus.reader(Depth::Stream, wait)?,
            requests: bus.reader(Depth::Stream, wait)?,
            changes: bus.reader(Depth::Stream, wait)?,
            presences: bus.reader(Depth::Stream, wait)?,
            scenario: Follower::ready(bus)?,
            complaints: Complaints::default(),
            refused: 0,
        })
    }

    /// Hands over all that was said on `bus` since the last call, topic by topic, each in its order.
    pub fn drain(&mut self, bus: &impl Bus, hear: &mut dyn FnMut(Message)) -> Result<(), BusError> {
        let Self { scenario, complaints, refused, .. } = self;
        let mut judge = Judge { complaints, refused };
        judge.drain(&mut *self.states, &mut |sample| {
            if let Some(offered) = scenario.follow(bus, &sample.header)? {
                hear(Message::Scenario(Arc::new(offered)));
            }
            hear(Message::State(sample));
            Ok(())
        })?;
        judge.pass_on(&mut *self.torques, Message::Torque, hear)?;
        judge.pass_on(&mut *self.errors, Message::Error, hear)?;
        judge.drain(&mut *self.statuses, &mut |sample| {
            if let Some(offered) = scenario.follow(bus, &sample.header)? {
                hear(Message::Scenario(Arc::new(offered)));
            }
            hear(Message::Status(sample));
            Ok(())
        })?;
        judge.pass_on(&mut *self.requests, Message::Request, hear)?;
        judge.pass_on(&mut *self.changes, Message::Change, hear)?;
        judge.pass_on(&mut *self.presences, Message::Presence, hear)
    }

    /// Messages that were not acceptable, so far.
    pub fn rejected(&self) -> u64 {
        self.refused
            + self.states.malformed()
            + self.torques.malformed()
            + self.errors.malformed()
            + self.statuses.malformed()
            + self.requests.malformed()
            + self.changes.malformed()
            + self.presences.malformed()
    }
}

struct Judge<'a> {
    complaints: &'a mut Complaints,
    refused: &'a mut u64,
}

impl Judge<'_> {
    fn pass_on<S: Sample>(
        &mut self,
        reader: &mut dyn Reader<S>,
        message: fn(S) -> Message,
        hear: &mut dyn FnMut(Message),
    ) -> Result<(), BusError> {
        self.drain(reader, &mut |sample| {
            hear(message(sample));
            Ok(())
        })
    }

    fn drain<S: Sample>(
        &mut self,
        reader: &mut dyn Reader<S>,
        hear: &mut dyn FnMut(S) -> Result<(), BusError>,
    ) -> Result<(), BusError> {
        // A writer that is faster than this reader must not hold it for ever.
        for _ in 0..bus::STREAM_DEPTH {
            let Some(sample) = reader.take()? else { break };
            match gate::fault(&sample) {
                None => hear(sample)?,
                Some(fault) => {
                    *self.refused += 1;
                    self.complaints.once::<S>(fault);
                }
            }
        }
        Ok(())
    }
}
