//! The loop of the plant: events in order of time, each handled by the loop's rules.

use std::time::{Duration, Instant};

use mtj_model::{
    matrix,
    scenario::{ClockKind, Scenario},
};
use mtj_protocol::{
    bus::BusError,
    port::{Answer, Exchange},
    sample::{Header, Joints, StateSample, StatusSample, VERSION},
};
use nalgebra::SVector;

use crate::{
    actuator::Command,
    agenda::{Agenda, Event},
    clock::{Clock, Heard, Lockstep, Realtime},
    durations::Durations,
    engine::{Engine, engine},
    error::{LinkError, PlantError, Refusal},
    peer::Peer,
    report::{Measures, Report},
    request::{self, Answers, Changeable},
    sensor::Sensor,
    sequencer::{Commands, Departure, Sequencer, nanoseconds},
    trace::TraceRow,
    tracking::{Tracked, Tracking},
};

/// How often to repeat the first state until a controller answers it.
const RENDEZVOUS: Duration = Duration::from_millis(20);
/// How often to look for requests during a pause.
const GLANCE: Duration = Duration::from_millis(20);
/// For how many samples of a trace there is room from the beginning; a longer one grows.
const TRACED: u128 = 1 << 20;
/// How often monitors are told the truth, in the run's time, ns.
const STATUS_PERIOD_NS: u64 = 20_000_000;

/// A run's outcome.
#[derive(Debug)]
pub struct Outcome {
    /// Its measures.
    pub report: Report,
    /// Every sampling instant, if asked for.
    pub trace: Vec<TraceRow>,
    /// All round trips, if asked for.
    pub round_trips: Durations,
    /// Whether the run was stopped before its end.
    pub interrupted: bool,
    /// The scenario of the next run, if this one was ended by a reset.
    pub reset: Option<Scenario>,
}

/// How a run is watched.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    /// Keep a [`TraceRow`] for each sampling instant.
    pub trace: bool,
    /// Read clocks to measure round trips: only where the exchange crosses a bus.
    pub round_trips: bool,
}

/// Runs a scenario against the controller at the other end of `exchange`, which must know it under
/// the same `run` id. Waits for it as long as `proceed` says so.
pub fn run(
    scenario: &Scenario,
    run: u64,
    exchange: &mut dyn Exchange,
    watch: Watch,
    proceed: &dyn Fn() -> bool,
) -> Result<Outcome, PlantError> {
    run_engine(scenario, run, engine(scenario), exchange, watch, proceed)
}

/// Runs a scenario as [`run`] does, with an engine of one's own in place of the scenario's arm.
///
/// The engine begins at the scenario's initial state. What reports and traces say of the tip
/// follows from its joint angles and the scenario's arm. [`crate::engine`] shows how to write an
/// engine.
pub fn run_engine(
    scenario: &Scenario,
    run: u64,
    engine: Box<dyn Engine>,
    exchange: &mut dyn Exchange,
    watch: Watch,
    proceed: &dyn Fn() -> bool,
) -> Result<Outcome, PlantError> {
    let peer = Peer::new(exchange, proceed, watch.round_trips);
    let has_trace = watch.trace;
    match scenario.timing.clock {
        ClockKind::Lockstep => {
            Plant::<Lockstep>::new(scenario, run, engine, peer, has_trace)?.run()
        }
        ClockKind::Realtime => {
            Plant::<Realtime>::new(scenario, run, engine, peer, has_trace)?.run()
        }
    }
    .map_err(PlantError::from)
}

struct Plant<'a, C> {
    /// The current scenario; requests change it.
    scenario: Scenario,
    peer: Peer<'a>,
    /// Of the newest sample.
    header: Header,
    engine: Box<dyn Engine>,
    tracking: Tracking,
    sensor: Sensor,
    agenda: Agenda,
    sequencer: Sequencer,
    clock: C,
    next_status_ns: u64,
    measures: Measures,
    trace: Option<Vec<TraceRow>>,
    answers: Answers,
    /// Counts disturbances, so that only the end of the newest one ends it.
    disturbances: u64,
    is_paused: bool,
    is_reset: bool,
    is_stopped: bool,
}

impl<'a, C: Clock> Plant<'a, C> {
    fn new(
        scenario: &Scenario,
        run: u64,
        engine: Box<dyn Engine>,
        peer: Peer<'a>,
        has_trace: bool,
    ) -> Result<Self, LinkError> {
        let header = Header {
            version: VERSION,
            joints: scenario.arm.links.len() as u32,
            axes: scenario.task.axes.len() as u32,
            run,
            ..Header::default()
        };
        let samples =
            scenario.duration.as_nanos().div_ceil(scenario.timing.sample_period.as_nanos());
        Ok(Self {
            scenario: scenario.clone(),
            peer,
            header,
            engine,
            tracking: Tracking::new(scenario),
            sensor: Sensor::new(scenario.noise, scenario.seed),
            agenda: Agenda::new(),
            sequencer: Sequencer::new(scenario)?,
            clock: C::new(),
            next_status_ns: 0,
            measures: Measures::new(scenario),
            trace: has_trace.then(|| Vec::with_capacity(samples.min(TRACED) as usize)),
            answers: Answers::default(),
            disturbances: 0,
            is_paused: false,
            is_reset: false,
            is_stopped: false,
        })
    }

    /// Pops events in order of time until the run's duration is over.
    fn run(mut self) -> Result<Outcome, BusError> {
        let end_ns = nanoseconds(self.scenario.duration);
        self.meet_controller()?;
        while !self.is_stopped && !self.sequencer.has_diverged() && !self.is_reset {
            let next = self.agenda.next_time().filter(|time| *time < end_ns).unwrap_or(end_ns);
            let heard = self.clock.wait(&mut self.peer, &mut self.sequencer, next)?;
            if heard != Heard::Nothing {
                self.take(heard);
                continue; // What came may be due earlier.
            }
            if next == end_ns {
                self.advance(end_ns);
                break;
            }
            if let Some((time_ns, event)) = self.agenda.pop() {
                if event.concerns_the_arm() {
                    self.advance(time_ns);
                }
                self.handle(time_ns, event)?;
            }
        }
        self.clock.end(&self.peer, &mut self.sequencer, self.engine.state().time_ns);
        self.report_status(2)?;
        Ok(self.outcome())
    }

    fn advance(&mut self, time_ns: u64) {
        self.engine.advance(time_ns, self.sequencer.actuator().drive());
        self.sequencer.observe(&self.engine.state().velocity);
    }

    fn handle(&mut self, time_ns: u64, event: Event) -> Result<(), BusError> {
        match event {
            Event::Sample => {
                let is_due = time_ns >= self.next_status_ns;
                if is_due {
                    self.attend(time_ns)?;
                    if self.is_paused {
                        self.stand_still(time_ns)?;
                    }
                }
                self.take_sample(time_ns);
                if is_due {
                    self.next_status_ns = time_ns + STATUS_PERIOD_NS;
                    self.report_status(1)?;
                }
            }
            Event::Deliver(state) => self.deliver(time_ns, state)?,
            Event::Arrive(command) => self.apply(time_ns, &command),
            Event::Timeout(commands) => self.sequencer.time_out(commands, time_ns),
            Event::EndDisturbance(disturbance) => {
                if disturbance == self.disturbances {
                    self.engine.disturb([0.0; _]);
                }
            }
        }
        Ok(())
    }

    /// Takes the first sample and repeats it until a controller answers; then the clock starts,
    /// with that answer in hand.
    fn meet_controller(&mut self) -> Result<(), BusError> {
        let mut state = self.measure(0);
        self.set_deadline(0);
        let transit = self.sequencer.state_transit(0);
        self.sequencer.hand_over(0);
        let started = Instant::now();
        let mut has_complained = false;
        let answer = loop {
            if let Some(answer) = self.peer.ask(&mut state, RENDEZVOUS)? {
                break answer;
            }
            if !self.peer.may_proceed() {
                self.is_stopped = true;
                return Ok(());
            }
            self.report_status(0)?;
            self.attend(0)?;
            if self.is_reset {
                return Ok(());
            }
            if !has_complained && started.elapsed() > Duration::from_secs(2) {
                has_complained = true;
                tracing::info!(
                    "waiting for a controller in session '{}' on {}",
                    self.scenario.bus.session,
                    self.scenario.bus.kind.name()
                );
            }
        };
        self.clock.start();
        if let (Answer::Torque, Some(delivered_ns)) = (answer, transit) {
            self.take(Heard::Torque(delivered_ns));
        }
        Ok(())
    }

    /// Measures the state, and sends it on its way.
    fn take_sample(&mut self, time_ns: u64) {
        self.clock.sample(time_ns, self.sequencer.period_ns());
        let state = self.measure(time_ns);
        if let Some(transit) = self.sequencer.state_transit(state.header.sequence) {
            self.agenda.push(time_ns + transit, Event::Deliver(state));
        }
    }

    fn measure(&mut self, time_ns: u64) -> StateSample {
        self.header.sequence = self.sequencer.sample(time_ns);
        self.header.time_ns = time_ns;
        self.agenda.push(self.sequencer.next_sample_ns(), Event::Sample);
        let truth = self.engine.state();
        let Tracked { tip, desired, error } = self.tracking.at(&truth);
        self.measures.sample(time_ns, matrix::squared_norm(&SVector::from(error)));
        let actuator = self.sequencer.actuator();
        if let Some(trace) = &mut self.trace {
            trace.push(TraceRow {
                time: time_ns as f64 * 1e-9,
                position: truth.position,
                velocity: truth.velocity,
                tip,
                desired,
                error,
                torque: actuator.torque(&truth.velocity),
                echo: actuator.applied(),
            });
        }
        let (position, velocity) = self.sensor.measure(truth.position, truth.velocity);
        StateSample {
            header: self.header,
            sent_ns: 0,
            latency_ns: actuator.latency_ns(),
            round_trip_ns: self.peer.round_trip_ns(),
            residence_ns: self.peer.residence_ns(),
            leader: 0,
            timed_out: u64::from(actuator.has_timed_out()),
            echo_count: actuator.echo_count(),
            position,
            velocity,
            applied: actuator.applied(),
            delivered: self.sequencer.delivered(time_ns),
        }
    }

    /// Hands a state to the controller, unless a newer one has overtaken it.
    fn deliver(&mut self, time_ns: u64, mut state: StateSample) -> Result<(), BusError> {
        if self.sequencer.hand_over(state.header.sequence) {
            let (peer, sequencer) = (&mut self.peer, &mut self.sequencer);
            let heard = self.clock.hand_over(peer, sequencer, &mut state, time_ns)?;
            self.take(heard);
        }
        Ok(())
    }

    /// Sends a torque that came on its way to the arm.
    fn take(&mut self, heard: Heard) {
        match heard {
            Heard::Nothing => {}
            Heard::Stop => self.is_stopped = true,
            Heard::Torque(time_ns) => {
                let departure = self.sequencer.depart(time_ns, true);
                self.sequencer.count(departure);
                if let Departure::Arrives(arrives_ns) = departure {
                    let command = Command::from(self.peer.torque());
                    self.agenda.push(arrives_ns, Event::Arrive(command));
                }
            }
        }
    }

    fn apply(&mut self, time_ns: u64, command: &Command) {
        if self.sequencer.apply(command, time_ns) {
            self.clock.apply(time_ns);
            let velocity = self.engine.state().velocity;
            self.measures.command(&self.sequencer.actuator().torque(&velocity));
            self.set_deadline(time_ns);
        }
    }

    fn set_deadline(&mut self, time_ns: u64) {
        if let Some((deadline_ns, commands)) = self.sequencer.deadline(time_ns) {
            self.agenda.push(deadline_ns, Event::Timeout(commands));
        }
    }

    /// Handles the requests that have come. They are in effect from the sample at `time_ns` on,
    /// which is not taken yet.
    fn attend(&mut self, time_ns: u64) -> Result<(), BusError> {
        for _ in 0..request::AT_A_TIME {
            let Some(request) = self.peer.exchange().request()? else { break };
            let change = match self.answers.to(&request) {
                Some(change) => change,
                None => {
                    let revision = self.header.revision;
                    let mut target = BeforeSample { plant: self, time_ns };
                    let outcome = request::carry_out(&request, &mut target);
                    self.offer_changes(revision)?;
                    let sequence = self.sequencer.next_sequence();
                    let header = Header { time_ns, sequence, ..self.header };
                    self.answers.answer(header, &request, outcome)
                }
            };
            self.peer.exchange().announce(&change)?;
        }
        Ok(())
    }

    /// Offers the scenario if it was changed since this revision, before the first sample of the
    /// new one, so that a controller can fetch it there.
    fn offer_changes(&mut self, revision: u32) -> Result<(), BusError> {
        if self.header.revision == revision {
            return Ok(());
        }
        self.peer.exchange().renew(&self.scenario, self.header.revision)
    }

    /// Lets the run's time stand still at `time_ns` until it is to go on.
    fn stand_still(&mut self, time_ns: u64) -> Result<(), BusError> {
        let paused = Instant::now();
        while self.is_paused && !self.is_reset {
            let (peer, sequencer) = (&mut self.peer, &mut self.sequencer);
            let heard = self.clock.stand_still(peer, sequencer, time_ns, GLANCE)?;
            self.take(heard);
            if !self.peer.may_proceed() {
                self.is_stopped = true;
                break;
            }
            self.report_status(3)?;
            self.attend(time_ns)?;
        }
        self.clock.resume(paused.elapsed());
        self.next_status_ns = time_ns;
        Ok(())
    }

    fn report_status(&mut self, phase: u64) -> Result<(), BusError> {
        let truth = self.engine.state();
        let Commands { sent, applied, lost, late, .. } = self.sequencer.commands();
        let exchange = self.peer.exchange();
        exchange.report(&StatusSample {
            header: self.header,
            phase,
            sent,
            applied,
            lost,
            late,
            rejected: exchange.rejected(),
            deadline_misses: self.clock.deadline_misses().unwrap_or(0),
            timeouts: self.sequencer.timeouts(),
            takeovers: exchange.takeovers(),
            position: truth.position,
            velocity: truth.velocity,
            torque: self.sequencer.actuator().torque(&truth.velocity),
        })
    }

    fn outcome(mut self) -> Outcome {
        let truth = self.engine.state();
        let report =
            self.measures.report(&self.scenario, &self.sequencer, truth.time_ns, truth.energy);
        // The gate also counts samples that answer no state.
        let rejected = self.peer.exchange().rejected();
        let takeovers = self.peer.exchange().takeovers();
        let (round_trips, residences) = self.peer.into_durations();
        let report = Report {
            commands: Commands { rejected, ..report.commands },
            takeovers,
            deadline_misses: self.clock.deadline_misses(),
            longest_gap_us: self.clock.longest_gap_ns().map(|gap| gap as f64 * 1e-3),
            round_trip_us: round_trips.percentiles(),
            residence_us: residences.percentiles(),
            ..report
        };
        Outcome {
            report,
            trace: self.trace.unwrap_or_default(),
            round_trips,
            interrupted: self.is_stopped,
            reset: self.is_reset.then_some(self.scenario),
        }
    }
}

/// A plant just before the sample at an instant.
struct BeforeSample<'p, 'a, C> {
    plant: &'p mut Plant<'a, C>,
    time_ns: u64,
}

impl<C: Clock> Changeable for BeforeSample<'_, '_, C> {
    fn scenario(&self) -> &Scenario {
        &self.plant.scenario
    }

    fn change(&mut self, scenario: Scenario) -> Result<(), Refusal> {
        let plant = &mut *self.plant;
        plant.sequencer.reconfigure(&plant.scenario, &scenario)?;
        plant.sensor.set_noise(scenario.noise);
        plant.header.revision += 1;
        plant.scenario = scenario;
        Ok(())
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
    }

    fn reset(&mut self) {
        self.plant.is_reset = true;
    }
}
