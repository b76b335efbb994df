//! What operators ask of a running plant.

use std::time::Duration;

use mtj_protocol::{
    bus::BusError,
    sample::{Header, Joints, RequestSample},
};

use super::Plant;
use crate::{
    agenda::Event,
    clock::Clock,
    request::{self, Change, Changeable, Preparer},
};

impl<C: Clock> Plant<'_, C> {
    /// Hands over the requests that have come, and carries out those that are prepared. These are in
    /// effect from the sample at `time_ns` on, which is not taken yet.
    pub(super) fn attend(&mut self, time_ns: u64) -> Result<(), BusError> {
        for _ in 0..request::AT_A_TIME {
            if !self.preparer.as_ref().is_none_or(Preparer::has_room) {
                break;
            }
            let Some(request) = self.peer.exchange().request()? else { break };
            match self.answers.to(&request) {
                Some(change) => self.peer.exchange().announce(&change)?,
                None if self.under_way.contains(&request.header.sequence) => {}
                None => self.prepare(&request),
            }
        }
        let patience = if self.clock.stands_still() { Duration::MAX } else { Duration::ZERO };
        for _ in 0..request::AT_A_TIME {
            let prepared = self.preparer.as_mut().and_then(|preparer| preparer.take(patience));
            let Some((request, prepared)) = prepared else { break };
            self.under_way.retain(|number| *number != request.header.sequence);
            let revision = self.header.revision;
            let outcome = prepared
                .map(|prepared| prepared.carry_out(&mut BeforeSample { plant: self, time_ns }));
            self.offer_changes(revision)?;
            let sequence = self.sequencer.next_sequence();
            let header = Header { time_ns, sequence, ..self.header };
            let change = self.answers.answer(header, &request, outcome);
            self.peer.exchange().announce(&change)?;
        }
        Ok(())
    }

    /// Has a request prepared. If no thread can be started for it, its sender repeats it.
    fn prepare(&mut self, request: &RequestSample) {
        if self.preparer.is_none() {
            self.preparer = Preparer::start(&self.scenario).ok();
        }
        if let Some(preparer) = &mut self.preparer
            && preparer.submit(request)
        {
            self.under_way.push(request.header.sequence);
        }
    }

    /// Offers the scenario if it was changed since this revision, before the first sample of the
    /// new one, so that a controller can fetch it there.
    fn offer_changes(&mut self, revision: u32) -> Result<(), BusError> {
        if self.header.revision == revision {
            return Ok(());
        }
        self.peer.exchange().renew(&self.scenario, self.header.revision)
    }
}

/// A plant just before the sample at an instant.
struct BeforeSample<'p, 'a, C> {
    plant: &'p mut Plant<'a, C>,
    time_ns: u64,
}

impl<C: Clock> Changeable for BeforeSample<'_, '_, C> {
    fn change(&mut self, Change { mut scenario, links, gravity_terms }: Change) {
        let plant = &mut *self.plant;
        // The torque in effect may change here; what was before is integrated first.
        plant.advance(self.time_ns);
        scenario.follow(&plant.scenario, self.time_ns);
        let velocity = plant.engine.state().velocity;
        plant.sequencer.reconfigure(&scenario, links, self.time_ns, &velocity);
        plant.set_deadline();
        plant.engine.reconfigure(&scenario);
        plant.sensor.reconfigure(&scenario);
        if scenario.law != plant.scenario.law || scenario.safety != plant.scenario.safety {
            plant.gravity_terms = gravity_terms;
        }
        plant.header.revision += 1;
        if scenario.law != plant.scenario.law {
            plant.new_law_from = Some(plant.sequencer.next_sequence());
        }
        plant.scenario = scenario;
        plant.tell_timeout(self.time_ns);
    }

    fn disturb(&mut self, torque: Joints, duration_ns: u64) {
        let plant = &mut *self.plant;
        plant.advance(self.time_ns);
        plant.disturbances += 1;
        plant.engine.disturb(torque);
        let end = Event::EndDisturbance(plant.disturbances);
        plant.agenda.push(self.time_ns + duration_ns, end);
    }

    fn pause(&mut self, is_paused: bool) {
        self.plant.is_paused = is_paused;
        if !is_paused {
            self.plant.sequencer.release();
        }
    }

    fn reset(&mut self) {
        self.plant.is_reset = true;
    }
}
