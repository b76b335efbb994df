//! The plant's end of the bus.

use std::time::Instant;

use mtj_model::scenario::{Scenario, Wait};

use super::{
    Answer, Complaints, Exchange,
    presence::{Presence, RoleName},
};
use crate::{
    bus::{self, Bus, BusError, Depth, Offering, Reader, Writer},
    codec::{self, Offer},
    gate::{self, Fault, Gate, Verdict},
    sample::{ChangeSample, RequestSample, StateSample, StatusSample, TorqueSample, VERSION},
};

/// The plant's end: writes states, status and changes, reads torques and requests, offers the scenario.
pub struct PlantPort {
    states: Box<dyn Writer<StateSample>>,
    statuses: Box<dyn Writer<StatusSample>>,
    changes: Box<dyn Writer<ChangeSample>>,
    torques: Box<dyn Reader<TorqueSample>>,
    requests: Box<dyn Reader<RequestSample>>,
    presence: Presence,
    offering: Box<dyn Offering>,
    wait: Wait,
    run: u64,
    gate: Gate,
    complaints: Complaints,
}

impl PlantPort {
    /// Joins a bus with a scenario under a fresh run id.
    pub fn open(bus: &impl Bus, scenario: &Scenario, run: u64) -> Result<Self, BusError> {
        let wait = scenario.bus.wait;
        Ok(Self {
            states: bus.writer()?,
            statuses: bus.writer()?,
            changes: bus.writer()?,
            torques: bus.reader(Depth::Latest, wait)?,
            requests: bus.reader(Depth::Stream, Wait::Block)?,
            presence: Presence::open(bus, RoleName::Plant)?,
            offering: bus.offer(encode(scenario, run, 0))?,
            wait,
            run,
            gate: Gate::new(run),
            complaints: Complaints::default(),
        })
    }

    /// Begins another run on the same bus.
    pub fn restart(&mut self, scenario: &Scenario, run: u64) -> Result<(), BusError> {
        self.run = run;
        self.gate = Gate::new(run);
        self.renew(scenario, 0)
    }
}

fn encode(scenario: &Scenario, run: u64, revision: u32) -> Vec<u8> {
    codec::encode_offer(&Offer {
        version: VERSION,
        revision,
        run,
        name: scenario.name.clone(),
        text: scenario.text().to_owned(),
    })
}

impl Exchange for PlantPort {
    fn send(&mut self, state: &StateSample) -> Result<(), BusError> {
        self.states.write(state)
    }

    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        while let Some(torque) = bus::receive(&mut *self.torques, self.wait, until)? {
            match self.gate.judge(&torque) {
                Verdict::Fresh => return Ok(Some(Answer::Torque(torque))),
                Verdict::Repeated => {}
                Verdict::Refused(fault) => {
                    self.complaints.once::<TorqueSample>(fault);
                    if fault == Fault::NotFinite {
                        return Ok(Some(Answer::NotFinite(torque.header.sequence)));
                    }
                }
            }
        }
        Ok(None)
    }

    fn report(&mut self, status: &StatusSample) -> Result<(), BusError> {
        self.offering.serve()?;
        self.presence.tell(&status.header)?;
        self.statuses.write(status)
    }

    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        while let Some(request) = self.requests.take()? {
            match gate::fault(&request) {
                None if request.header.run == self.run => return Ok(Some(request)),
                None => self.complaints.once::<RequestSample>(Fault::Run),
                Some(fault) => self.complaints.once::<RequestSample>(fault),
            }
        }
        Ok(None)
    }

    fn announce(&mut self, change: &ChangeSample) -> Result<(), BusError> {
        self.changes.write(change)
    }

    fn renew(&mut self, scenario: &Scenario, revision: u32) -> Result<(), BusError> {
        self.offering.renew(encode(scenario, self.run, revision))
    }

    fn rejected(&self) -> u64 {
        self.gate.refused() + self.torques.malformed()
    }
}
