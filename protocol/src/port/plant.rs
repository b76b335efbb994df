//! The plant's end of the bus.

use std::{
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::{Scenario, Wait};

use super::{
    Answer, Exchange, Rejections, Tolerance, lease::Lease, offer::encode,
    other_plants::OtherPlants, presence::Presence, sent::SentStates,
};
use crate::{
    admission::{self, Admission, AdmissionFilter, Rejection},
    bus::{self, Bus, BusError, Depth, Offering, Reader, Writer},
    debug_by_name,
    member::{Member, Role},
    realtime,
    sample::{ChangeSample, RequestSample, StateSample, StatusSample, TorqueSample},
};

/// How long to wait before a reader that failed is asked again.
const PAUSE: Duration = Duration::from_millis(1);

/// The plant's end: writes states, status and changes, reads torques and requests, offers the
/// scenario.
///
/// Once it has joined, nothing that fails around it ends the plant: the [`Exchange`] of a port
/// returns no error.
pub struct PlantPort {
    states: Box<dyn Writer<StateSample>>,
    statuses: Box<dyn Writer<StatusSample>>,
    changes: Box<dyn Writer<ChangeSample>>,
    torques: Box<dyn Reader<TorqueSample>>,
    requests: Box<dyn Reader<RequestSample>>,
    other_plants: OtherPlants,
    presence: Presence,
    offering: Box<dyn Offering>,
    wait: Wait,
    run: u64,
    filter: AdmissionFilter,
    lease: Lease,
    sent: SentStates,
    rejections: Rejections,
    tolerance: Tolerance,
}

debug_by_name!(PlantPort);

impl PlantPort {
    /// Joins a bus with a scenario, under a fresh run id.
    ///
    /// # Errors
    ///
    /// [`BusError::SecondPlant`] if the session has a plant, or what the transport says.
    pub fn open(bus: &impl Bus, scenario: &Scenario, run: u64) -> Result<Self, BusError> {
        let wait = realtime::affordable(scenario.bus.wait);
        let member = Member::new(Role::Plant, 0);
        Ok(Self {
            other_plants: OtherPlants::watch(bus, &scenario.bus.session, &member)?,
            states: bus.writer()?,
            statuses: bus.writer()?,
            changes: bus.writer()?,
            torques: bus.reader(Depth::Recent, wait)?,
            requests: bus.reader(Depth::Stream, Wait::Block)?,
            presence: Presence::open(bus, &member)?,
            offering: bus.offer(encode(scenario, run, 0))?,
            wait,
            run,
            filter: AdmissionFilter::new(run).for_scenario(scenario),
            lease: Lease::new(scenario.safety.lease, bus.attendance()?),
            sent: SentStates::new(),
            rejections: Rejections::default(),
            tolerance: Tolerance::default(),
        })
    }

    /// Begins another run on the same bus.
    pub fn restart(&mut self, scenario: &Scenario, run: u64) -> Result<(), BusError> {
        self.run = run;
        self.filter = AdmissionFilter::new(run).for_scenario(scenario);
        self.sent = SentStates::new();
        self.lease.restart();
        self.renew(scenario, 0)
    }

    /// Admits the current torque: the filter checks the sample, the port that its leader answers a
    /// state.
    fn admit(&mut self) -> Admission {
        let torque = self.torques.sample();
        let (sent, lease) = (&self.sent, &self.lease);
        let admission = self.filter.admit_if(torque, |torque| {
            let is_leader = lease.allows(torque.controller);
            let not_leader = (!is_leader).then_some(Rejection::NotLeader);
            sent.objection(torque).or(not_leader)
        });
        match admission {
            Admission::Fresh => {
                self.lease.renew(torque.controller);
                self.sent.answers = 1;
            }
            Admission::Repeated => {
                self.sent.answers += 1;
                if torque.header.sequence < self.sent.newest.header.sequence
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

    /// Sends a state.
    fn send_state(&mut self, state: &mut StateSample) {
        self.tolerance.tolerate("elect a leader", self.lease.decide());
        state.leader = self.lease.leader().unwrap_or(0);
        self.tolerance.tolerate("send states", self.states.expedite(state));
        // From here on the state is on its way, and its answer takes longer than this.
        self.lease.sent(Instant::now());
        self.sent.record(state);
    }

    /// Makes the state that was sent visible to all readers.
    fn flush(&mut self) {
        self.tolerance.tolerate("send states", self.states.flush());
        self.tolerance.tolerate("follow the leader", self.torques.follow());
    }

    /// Waits for an answer until `until`.
    fn receive_until(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
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
        self.flush();
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
            if lapse.is_some() {
                self.tolerance.tolerate("elect a leader", self.lease.decide());
                if self.lease.leader() != before {
                    let mut state = self.sent.newest;
                    self.send_state(&mut state);
                }
            }
        }
    }
}

impl Exchange for PlantPort {
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError> {
        self.send_state(state);
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError> {
        let received = self.receive_until(until);
        if received.is_err() {
            // A reader that fails at once would leave no processor to the rest.
            thread::sleep(until.saturating_duration_since(Instant::now()).min(PAUSE));
        }
        Ok(self.tolerance.tolerate("receive torques", received))
    }

    fn torque(&self) -> &TorqueSample {
        self.torques.sample()
    }

    fn report(&mut self, status: &StatusSample) -> Result<(), BusError> {
        self.tolerance.tolerate("offer the scenario", self.offering.serve());
        self.tolerance.tolerate("publish the presence", self.presence.publish(&status.header));
        self.tolerance.tolerate("publish the status", self.statuses.write(status));
        self.tolerance.tolerate("look for other plants", self.other_plants.look());
        Ok(())
    }

    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        for _ in 0..bus::STREAM_DEPTH {
            let taken = self.requests.take();
            let Some(request) = self.tolerance.tolerate("read requests", taken) else { break };
            match admission::check(&request) {
                Ok(()) if request.header.run == self.run => return Ok(Some(request)),
                Ok(()) => self.rejections.warn::<RequestSample>(Rejection::Run),
                Err(rejection) => self.rejections.warn::<RequestSample>(rejection),
            }
        }
        Ok(None)
    }

    fn announce(&mut self, change: &ChangeSample) -> Result<(), BusError> {
        self.tolerance.tolerate("answer requests", self.changes.write(change));
        Ok(())
    }

    fn renew(&mut self, scenario: &Scenario, revision: u32) -> Result<(), BusError> {
        self.lease.reconfigure(scenario.safety.lease);
        let offer = encode(scenario, self.run, revision);
        self.tolerance.tolerate("offer the scenario", self.offering.renew(offer));
        Ok(())
    }

    fn takeovers(&self) -> u64 {
        self.lease.takeovers()
    }

    fn rejected(&self) -> u64 {
        self.filter.rejected() + self.torques.malformed()
    }
}
