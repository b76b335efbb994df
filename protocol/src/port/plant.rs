//! The plant's end of the bus.

use std::time::Instant;

use mtj_model::scenario::{Scenario, Wait};

use super::{Answer, Complaints, Exchange, lease::Lease, offer::encode, presence::Presence};
use crate::{
    bus::{self, Bus, BusError, Depth, Offering, Reader, Writer},
    gate::{self, Fault, Gate, Verdict},
    member::{Member, Role},
    sample::{ChangeSample, RequestSample, StateSample, StatusSample, TorqueSample},
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
    lease: Lease,
    asked: Asked,
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
            torques: bus.reader(Depth::Recent, wait)?,
            requests: bus.reader(Depth::Stream, Wait::Block)?,
            presence: Presence::open(bus, &Member::new(Role::Plant, 0))?,
            offering: bus.offer(encode(scenario, run, 0))?,
            wait,
            run,
            gate: Gate::new(run).for_scenario(scenario),
            lease: Lease::new(scenario.safety.lease, bus.attendance()?),
            asked: Asked::default(),
            complaints: Complaints::default(),
        })
    }

    /// Begins another run on the same bus.
    pub fn restart(&mut self, scenario: &Scenario, run: u64) -> Result<(), BusError> {
        self.run = run;
        self.gate = Gate::new(run).for_scenario(scenario);
        self.asked = Asked::default();
        self.lease.restart();
        self.renew(scenario, 0)
    }

    /// Whether a torque may pass: the gate knows samples, we know what was asked, and whom.
    fn judge(&mut self) -> Verdict {
        let torque = self.torques.sample();
        let (asked, lease) = (self.asked.state.header.sequence, &self.lease);
        let verdict = self.gate.judge_if(torque, |torque| match torque.header.sequence > asked {
            true => Some(Fault::Unasked),
            false => (!lease.allows(torque.controller)).then_some(Fault::NotInCharge),
        });
        match verdict {
            Verdict::Fresh => {
                self.lease.answered(torque.controller);
                self.asked.answers = 1;
            }
            Verdict::Repeated => {
                self.asked.answers += 1;
                if torque.header.sequence < self.asked.state.header.sequence
                    || self.asked.answers > self.asked.times
                {
                    return self.gate.refuse(Fault::Duplicate);
                }
            }
            Verdict::Refused(_) => {}
        }
        verdict
    }

    /// Goes on to the next answer that may pass, waiting for it until `until`.
    fn listen(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        while bus::receive(&mut *self.torques, self.wait, until)? {
            match self.judge() {
                Verdict::Fresh => return Ok(Some(Answer::Torque)),
                Verdict::Repeated => {}
                Verdict::Refused(fault) => {
                    self.complaints.once::<TorqueSample>(fault);
                    if fault == Fault::NotFinite {
                        return Ok(Some(Answer::NotFinite));
                    }
                }
            }
            // A writer that is faster than we listen must not hold us for ever.
            if Instant::now() >= until {
                break;
            }
        }
        Ok(None)
    }
}

/// What the controller was asked last.
#[derive(Default)]
struct Asked {
    state: StateSample,
    /// How often: a state is repeated as long as nobody answers it.
    times: u64,
    answers: u64,
}

impl Exchange for PlantPort {
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError> {
        state.leader = self.lease.decide()?;
        self.states.expedite(state)?;
        // From here on it is on its way, and its answer takes longer than this.
        self.lease.asked(Instant::now());
        let is_again =
            self.asked.times > 0 && self.asked.state.header.sequence == state.header.sequence;
        let (times, answers) =
            if is_again { (self.asked.times + 1, self.asked.answers) } else { (1, 0) };
        self.asked = Asked { state: *state, times, answers };
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        // As long as the controller that answered before may answer now, there is nothing to do but wait; unless
        // it follows nobody, as a program that knows only the stream.
        let is_close = self.torques.follows() && self.lease.is_proven();
        if self.asked.answers == 0
            && let Some(lapse) = self.lease.lapse().filter(|_| is_close)
            && let Some(answer) = self.listen(lapse.min(until))?
        {
            return Ok(Some(answer));
        }
        // Now monitors have their turn, and those who do not follow us yet.
        self.states.settle()?;
        self.torques.follow()?;
        loop {
            let lapse = self.lease.lapse().filter(|lapse| *lapse < until);
            if let Some(answer) = self.listen(lapse.unwrap_or(until))? {
                return Ok(Some(answer));
            }
            if Instant::now() >= until {
                return Ok(None);
            }
            // A controller that takes over need not wait for the next sample.
            let before = self.lease.leader();
            if lapse.is_some() && self.lease.decide()? != before {
                let mut state = self.asked.state;
                self.send(&mut state)?;
            }
        }
    }

    fn torque(&self) -> &TorqueSample {
        self.torques.sample()
    }

    fn report(&mut self, status: &StatusSample) -> Result<(), BusError> {
        self.offering.serve()?;
        self.presence.tell(&status.header)?;
        self.statuses.write(status)
    }

    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        for _ in 0..bus::STREAM_DEPTH {
            let Some(request) = self.requests.take()? else { break };
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
        self.lease.reconfigure(scenario.safety.lease);
        self.offering.renew(encode(scenario, self.run, revision))
    }

    fn takeovers(&self) -> u64 {
        self.lease.takeovers()
    }

    fn rejected(&self) -> u64 {
        self.gate.refused() + self.torques.malformed()
    }
}
