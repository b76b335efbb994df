//! What each role may say and hear on a bus.

use std::time::{Duration, Instant};

use mtj_model::scenario::{Scenario, Wait};

use crate::{
    bus::{self, Bus, BusError, Depth, Offering, Reader, Writer},
    codec::{self, Offer},
    gate::{Fault, Gate, Verdict},
    sample::{ErrorSample, Sample, StateSample, StatusSample, TorqueSample, VERSION},
};

/// The two-way exchange that closes the loop, as the plant sees it.
pub trait Exchange {
    /// Hands a state to the controller.
    fn send(&mut self, state: &StateSample) -> Result<(), BusError>;
    /// The controller's next answer, waiting for it until `until`.
    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError>;
    /// Tells monitors how the run goes.
    fn report(&mut self, status: &StatusSample) -> Result<(), BusError>;
    /// Torque samples that were not acceptable, so far.
    fn rejected(&self) -> u64;
}

/// A controller's answer to a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// A torque that may act on the arm.
    Torque(TorqueSample),
    /// A torque for this sequence number that must not, because it is not finite.
    NotFinite(u64),
}

impl Answer {
    /// Of the state that was answered.
    pub fn sequence(&self) -> u64 {
        match self {
            Self::Torque(torque) => torque.header.sequence,
            Self::NotFinite(sequence) => *sequence,
        }
    }
}

/// The plant's end: writes states and status, reads torques, offers the scenario.
pub struct PlantPort {
    states: Box<dyn Writer<StateSample>>,
    statuses: Box<dyn Writer<StatusSample>>,
    torques: Box<dyn Reader<TorqueSample>>,
    offering: Box<dyn Offering>,
    wait: Wait,
    gate: Gate,
    complaints: Complaints,
}

impl PlantPort {
    /// Joins a bus with a scenario under a fresh run id.
    pub fn open(bus: &impl Bus, scenario: &Scenario, run: u64) -> Result<Self, BusError> {
        let wait = scenario.bus.wait;
        let offer = Offer {
            version: VERSION,
            run,
            name: scenario.name.clone(),
            text: scenario.text().to_owned(),
        };
        Ok(Self {
            states: bus.writer()?,
            statuses: bus.writer()?,
            torques: bus.reader(Depth::Latest, wait)?,
            offering: bus.offer(codec::encode_offer(&offer))?,
            wait,
            gate: Gate::new(run),
            complaints: Complaints::default(),
        })
    }
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
        self.statuses.write(status)
    }

    fn rejected(&self) -> u64 {
        self.gate.refused() + self.torques.malformed()
    }
}

/// What a controller hears.
pub enum Heard {
    /// A state to answer.
    State(StateSample),
    /// The state it has answered already, once more: the plant wants that answer again.
    Again(StateSample),
    /// A state of a plant with another scenario than the one it has.
    OtherRun(u64),
}

/// A controller's end: reads states, writes torques and errors.
pub struct ControllerPort {
    states: Box<dyn Reader<StateSample>>,
    torques: Box<dyn Writer<TorqueSample>>,
    errors: Box<dyn Writer<ErrorSample>>,
    wait: Wait,
    gate: Gate,
    complaints: Complaints,
}

impl ControllerPort {
    /// Joins a bus for one run of the plant.
    pub fn open(bus: &impl Bus, run: u64, wait: Wait) -> Result<Self, BusError> {
        Ok(Self {
            states: bus.reader(Depth::Latest, wait)?,
            torques: bus.writer()?,
            errors: bus.writer()?,
            wait,
            gate: Gate::new(run),
            complaints: Complaints::default(),
        })
    }

    /// The next acceptable state, waiting for it until `until`.
    pub fn receive(&mut self, until: Instant) -> Result<Option<Heard>, BusError> {
        while let Some(state) = bus::receive(&mut *self.states, self.wait, until)? {
            match self.gate.judge(&state) {
                Verdict::Fresh => return Ok(Some(Heard::State(state))),
                Verdict::Repeated => return Ok(Some(Heard::Again(state))),
                Verdict::Refused(Fault::Run) => return Ok(Some(Heard::OtherRun(state.header.run))),
                Verdict::Refused(fault) => self.complaints.once::<StateSample>(fault),
            }
        }
        Ok(None)
    }

    /// Answers a state.
    pub fn send(&mut self, torque: &TorqueSample) -> Result<(), BusError> {
        self.torques.write(torque)
    }

    /// Tells monitors how the law saw the instant. Off the critical path: after [`Self::send`].
    pub fn publish(&mut self, error: &ErrorSample) -> Result<(), BusError> {
        self.errors.write(error)
    }

    /// State samples that were not acceptable, so far.
    pub fn rejected(&self) -> u64 {
        self.gate.refused() + self.states.malformed()
    }
}

/// A monitor's end: reads everything, writes nothing.
pub struct MonitorPort {
    states: Box<dyn Reader<StateSample>>,
    torques: Box<dyn Reader<TorqueSample>>,
    errors: Box<dyn Reader<ErrorSample>>,
    statuses: Box<dyn Reader<StatusSample>>,
    complaints: Complaints,
    refused: u64,
}

/// Anything that is said in a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Message {
    /// Plant to controller.
    State(StateSample),
    /// Controller to plant.
    Torque(TorqueSample),
    /// Controller to monitors.
    Error(ErrorSample),
    /// Plant to monitors.
    Status(StatusSample),
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
            complaints: Complaints::default(),
            refused: 0,
        })
    }

    /// Hands over all that was said since the last call, topic by topic, each in its order.
    pub fn drain(&mut self, mut hear: impl FnMut(Message)) -> Result<(), BusError> {
        let Self { states, torques, errors, statuses, complaints, refused } = self;
        let mut judge = Judge { complaints, refused };
        judge.drain(&mut **states, &mut |sample| hear(Message::State(sample)))?;
        judge.drain(&mut **torques, &mut |sample| hear(Message::Torque(sample)))?;
        judge.drain(&mut **errors, &mut |sample| hear(Message::Error(sample)))?;
        judge.drain(&mut **statuses, &mut |sample| hear(Message::Status(sample)))
    }

    /// Messages that were not acceptable, so far.
    pub fn rejected(&self) -> u64 {
        self.refused
            + self.states.malformed()
            + self.torques.malformed()
            + self.errors.malformed()
            + self.statuses.malformed()
    }
}

struct Judge<'a> {
    complaints: &'a mut Complaints,
    refused: &'a mut u64,
}

impl Judge<'_> {
    fn drain<S: Sample>(
        &mut self,
        reader: &mut dyn Reader<S>,
        hear: &mut dyn FnMut(S),
    ) -> Result<(), BusError> {
        // A writer that is faster than this reader must not hold it for ever.
        for _ in 0..bus::STREAM_DEPTH {
            let Some(sample) = reader.take()? else { break };
            match crate::gate::fault(&sample) {
                None => hear(sample),
                Some(fault) => {
                    *self.refused += 1;
                    self.complaints.once::<S>(fault);
                }
            }
        }
        Ok(())
    }
}

/// Fetches the scenario that a plant offers, waiting for one as long as `proceed` says so; `None`
/// when it no longer does.
pub fn fetch_scenario(
    bus: &impl Bus,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<(u64, Scenario)>, BusError> {
    let mut complained = false;
    let started = Instant::now();
    let mut is_waiting = false;
    while proceed() {
        if !is_waiting && started.elapsed() > Duration::from_secs(2) {
            is_waiting = true;
            eprintln!("mtj: there is no plant in this session yet; waiting for one");
        }
        let found = bus.fetch()?.map(|bytes| accept(&bytes));
        match found {
            Some(Ok(found)) => return Ok(Some(found)),
            Some(Err(sentence)) if !complained => {
                eprintln!("mtj: {sentence}");
                complained = true;
            }
            _ => {}
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Ok(None)
}

fn accept(bytes: &[u8]) -> Result<(u64, Scenario), String> {
    let offer =
        codec::decode_offer(bytes).ok_or("ignoring a scenario that could not be decoded")?;
    if offer.version != VERSION {
        return Err(format!(
            "ignoring a scenario from a plant of another version; {}",
            Fault::Version.sentence()
        ));
    }
    let scenario = Scenario::parse(&offer.name, &offer.text, &[])
        .map_err(|error| format!("ignoring the plant's scenario: {error}"))?;
    Ok((offer.run, scenario))
}

/// Says what is wrong with the samples of others, once for each kind of fault.
#[derive(Default)]
struct Complaints(Vec<Fault>);

impl Complaints {
    fn once<S: Sample>(&mut self, fault: Fault) {
        if !self.0.contains(&fault) {
            self.0.push(fault);
            eprintln!(
                "mtj: ignoring a {} sample: {} (said once, counted always)",
                S::TOPIC,
                fault.sentence()
            );
        }
    }
}
