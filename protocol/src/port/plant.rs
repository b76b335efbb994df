//! The plant's end of the bus.

use std::time::Instant;

use mtj_model::scenario::{Scenario, Wait};

use super::{Answer, Exchange, Rejections, lease::Lease, offer::encode, presence::Presence};
use crate::{
    admission::{self, Admission, AdmissionFilter, Rejection},
    bus::{self, Bus, BusError, Depth, Offering, Reader, Writer},
    debug_by_name,
    member::{Member, Role},
    sample::{ChangeSample, RequestSample, StateSample, StatusSample, TorqueSample},
};

/// The plant's end: writes states, status and changes, reads torques and requests, offers the
/// scenario.
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
    filter: AdmissionFilter,
    lease: Lease,
    sent: Sent,
    rejections: Rejections,
}

debug_by_name!(PlantPort);

impl PlantPort {
    /// Joins a bus with a scenario, under a fresh run id.
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
            filter: AdmissionFilter::new(run).for_scenario(scenario),
            lease: Lease::new(scenario.safety.lease, bus.attendance()?),
            sent: Sent::default(),
            rejections: Rejections::default(),
        })
    }

    /// Begins another run on the same bus.
    pub fn restart(&mut self, scenario: &Scenario, run: u64) -> Result<(), BusError> {
        self.run = run;
        self.filter = AdmissionFilter::new(run).for_scenario(scenario);
        self.sent = Sent::default();
        self.lease.restart();
        self.renew(scenario, 0)
    }

    /// Admits the current torque: the filter checks the sample, the port that its leader answers a
    /// state.
    fn admit(&mut self) -> Admission {
        let torque = self.torques.sample();
        let (asked, lease) = (self.sent.state.header.sequence, &self.lease);
        let admission =
            self.filter.admit_if(torque, |torque| match torque.header.sequence > asked {
                true => Some(Rejection::Unasked),
                false => (!lease.allows(torque.controller)).then_some(Rejection::NotLeader),
            });
        match admission {
            Admission::Fresh => {
                self.lease.renew(torque.controller);
                self.sent.answers = 1;
            }
            Admission::Repeated => {
                self.sent.answers += 1;
                if torque.header.sequence < self.sent.state.header.sequence
                    || self.sent.answers > self.sent.times
                {
                    return self.filter.reject(Rejection::Duplicate);
                }
            }
            Admission::Rejected(_) => {}
        }
        admission
    }

    /// Advances to the next admissible answer; waits for it until `until`.
    fn listen(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        while bus::receive(&mut *self.torques, self.wait, until)? {
            match self.admit() {
                Admission::Fresh => return Ok(Some(Answer::Torque)),
                Admission::Repeated => {}
                Admission::Rejected(rejection) => {
                    self.rejections.warn::<TorqueSample>(rejection);
                    if rejection == Rejection::NotFinite {
                        return Ok(Some(Answer::NotFinite));
                    }
                }
            }
            // A writer that is faster than this reader must not hold us for ever.
            if Instant::now() >= until {
                break;
            }
        }
        Ok(None)
    }
}

/// The state that was sent last.
#[derive(Default)]
struct Sent {
    state: StateSample,
    /// How often it was sent: a state is repeated until a controller answers it.
    times: u64,
    answers: u64,
}

impl Exchange for PlantPort {
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError> {
        state.leader = self.lease.decide()?.unwrap_or(0);
        self.states.expedite(state)?;
        // From here on the state is on its way, and its answer takes longer than this.
        self.lease.sent(Instant::now());
        let is_again =
            self.sent.times > 0 && self.sent.state.header.sequence == state.header.sequence;
        let (times, answers) =
            if is_again { (self.sent.times + 1, self.sent.answers) } else { (1, 0) };
        self.sent = Sent { state: *state, times, answers };
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        // While the leader that answered before may still answer, only wait. A leader that does not
        // follow our states, such as a program that reads only the stream, needs the flush below
        // first.
        let is_close = self.torques.follows() && self.lease.is_proven();
        if self.sent.answers == 0
            && let Some(lapse) = self.lease.lapse().filter(|_| is_close)
            && let Some(answer) = self.listen(lapse.min(until))?
        {
            return Ok(Some(answer));
        }
        // Now the state goes to monitors, and to controllers that do not follow us yet.
        self.states.flush()?;
        self.torques.follow()?;
        loop {
            let lapse = self.lease.lapse().filter(|lapse| *lapse < until);
            if let Some(answer) = self.listen(lapse.unwrap_or(until))? {
                return Ok(Some(answer));
            }
            if Instant::now() >= until {
                return Ok(None);
            }
            // A new leader need not wait for the next sample.
            let before = self.lease.leader();
            if lapse.is_some() && self.lease.decide()? != before {
                let mut state = self.sent.state;
                self.send(&mut state)?;
            }
        }
    }

    fn torque(&self) -> &TorqueSample {
        self.torques.sample()
    }

    fn report(&mut self, status: &StatusSample) -> Result<(), BusError> {
        self.offering.serve()?;
        self.presence.publish(&status.header)?;
        self.statuses.write(status)
    }

    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        for _ in 0..bus::STREAM_DEPTH {
            let Some(request) = self.requests.take()? else { break };
            match admission::check(&request) {
                Ok(()) if request.header.run == self.run => return Ok(Some(request)),
                Ok(()) => self.rejections.warn::<RequestSample>(Rejection::Run),
                Err(rejection) => self.rejections.warn::<RequestSample>(rejection),
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
        self.filter.rejected() + self.torques.malformed()
    }
}
