//! A monitor's end of the bus.

use std::sync::Arc;

use mtj_model::scenario::Wait;

use super::{Offered, Rejections, offer::Follower};
use crate::{
    admission,
    bus::{self, Bus, BusError, Depth, Reader},
    debug_by_name,
    sample::{
        ChangeSample, ErrorSample, PresenceSample, RequestSample, Sample, StateSample,
        StatusSample, TorqueSample,
    },
};

/// Any message of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// The scenario of a run, as offered or changed; comes before the samples it is about.
    Scenario(Arc<Offered>),
    /// Plant to controller.
    State(StateSample),
    /// Controller to plant.
    Torque(TorqueSample),
    /// Controller to monitors.
    Error(ErrorSample),
    /// Plant to monitors.
    Status(StatusSample),
    /// Operator to plant.
    Request(RequestSample),
    /// Plant to all.
    Change(ChangeSample),
    /// Any role to monitors.
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
    rejections: Rejections,
    rejected: u64,
}

debug_by_name!(MonitorPort);

impl MonitorPort {
    /// Joins a bus.
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
            scenario: Follower::subscribe(bus)?,
            rejections: Rejections::default(),
            rejected: 0,
        })
    }

    /// Hands over all messages since the last call, topic by topic, each in its order.
    pub fn drain(&mut self, bus: &impl Bus, hear: &mut dyn FnMut(Message)) -> Result<(), BusError> {
        let Self { scenario, rejections, rejected, .. } = self;
        let mut check = Check { rejections, rejected };
        check.drain(&mut *self.states, &mut |sample| {
            if let Some(offered) = scenario.follow(bus, &sample.header)? {
                hear(Message::Scenario(Arc::new(offered)));
            }
            hear(Message::State(sample));
            Ok(())
        })?;
        check.pass_on(&mut *self.torques, Message::Torque, hear)?;
        check.pass_on(&mut *self.errors, Message::Error, hear)?;
        check.drain(&mut *self.statuses, &mut |sample| {
            if let Some(offered) = scenario.follow(bus, &sample.header)? {
                hear(Message::Scenario(Arc::new(offered)));
            }
            hear(Message::Status(sample));
            Ok(())
        })?;
        check.pass_on(&mut *self.requests, Message::Request, hear)?;
        check.pass_on(&mut *self.changes, Message::Change, hear)?;
        check.pass_on(&mut *self.presences, Message::Presence, hear)
    }

    /// How many messages were not acceptable.
    pub fn rejected(&self) -> u64 {
        self.rejected
            + self.states.malformed()
            + self.torques.malformed()
            + self.errors.malformed()
            + self.statuses.malformed()
            + self.requests.malformed()
            + self.changes.malformed()
            + self.presences.malformed()
    }
}

/// Checks samples, and counts those that are not acceptable.
struct Check<'a> {
    rejections: &'a mut Rejections,
    rejected: &'a mut u64,
}

impl Check<'_> {
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
            match admission::check(&sample) {
                Ok(()) => hear(sample)?,
                Err(rejection) => {
                    *self.rejected += 1;
                    self.rejections.warn::<S>(rejection);
                }
            }
        }
        Ok(())
    }
}
