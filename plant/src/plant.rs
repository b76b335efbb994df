//! The loop of the plant: events in order of time, each handled by the loop's rules.

mod messages;
mod operator;

use std::time::{Duration, Instant};

use mtj_model::{
    matrix,
    scenario::{ClockKind, Scenario},
};
use mtj_protocol::{
    bus::BusError,
    port::{Answer, Exchange},
    sample::{Header, Joints, Phase, StateSample, StatusSample, VERSION},
};
use nalgebra::SVector;

use self::messages::tell_stop;
use crate::{
    actuator::Command,
    agenda::{Agenda, Event},
    clock::{Clock, Heard, Lockstep, Realtime},
    durations::{Durations, nanoseconds},
    engine::{Engine, engine},
    error::{LinkError, PlantError},
    gravity::GravityTerms,
    peer::Peer,
    report::{Measures, Report},
    request::{self, Answers, Preparer},
    sensor::Sensor,
    sequencer::{Commands, Departure, Sequencer},
    trace::{TraceRow, TraceStream},
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
#[derive(Clone, Debug, Default)]
pub struct Watch {
    /// Keep a [`TraceRow`] for each sampling instant.
    pub trace: bool,
    /// Send each [`TraceRow`] there as soon as it is known.
    pub stream: Option<TraceStream>,
    /// Read clocks to measure round trips: only where the exchange crosses a bus.
    pub round_trips: bool,
    /// After a divergence wait for a reset, rather than end.
    pub keeps_open: bool,
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
    match scenario.timing.clock {
        ClockKind::Lockstep => Plant::<Lockstep>::new(scenario, run, engine, peer, watch)?.run(),
        ClockKind::Realtime => Plant::<Realtime>::new(scenario, run, engine, peer, watch)?.run(),
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
    gravity_terms: GravityTerms,
    agenda: Agenda,
    sequencer: Sequencer,
    clock: C,
    next_status_ns: u64,
    measures: Measures,
    keeps_open: bool,
    trace: Option<Vec<TraceRow>>,
    stream: Option<TraceStream>,
    /// Of the sample that is repeated until a controller answers it.
    first_row: Option<TraceRow>,
    answers: Answers,
    /// Where no bus is crossed, only from the first request on.
    preparer: Option<Preparer>,
    /// Numbers of the requests that are being prepared.
    under_way: Vec<u64>,
    /// Counts disturbances, so that only the end of the newest one ends it.
    disturbances: u64,
    /// Number of the first sample under a law that was changed, until its command takes effect.
    new_law_from: Option<u64>,
    is_paused: bool,
    is_timeout_told: bool,
    is_reset: bool,
    is_stopped: bool,
}

impl<'a, C: Clock> Plant<'a, C> {
    fn new(
        scenario: &Scenario,
        run: u64,
        engine: Box<dyn Engine>,
        peer: Peer<'a>,
        watch: Watch,
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
            sensor: Sensor::new(scenario),
            gravity_terms: GravityTerms::new(scenario),
            agenda: Agenda::new(),
            sequencer: Sequencer::new(scenario)?,
            clock: C::new(),
            next_status_ns: 0,
            measures: Measures::new(scenario),
            keeps_open: watch.keeps_open,
            stream: watch.stream,
            first_row: None,
            trace: watch.trace.then(|| Vec::with_capacity(samples.min(TRACED) as usize)),
            answers: Answers::default(),
            preparer: watch.round_trips.then(|| Preparer::start(scenario).ok()).flatten(),
            under_way: Vec::with_capacity(request::PENDING),
            disturbances: 0,
            new_law_from: None,
            is_paused: false,
            is_timeout_told: false,
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
        let end_ns = self.engine.state().time_ns;
        self.clock.end(&self.peer, &mut self.sequencer, end_ns);
        if self.keeps_open && self.sequencer.has_diverged() && !self.is_stopped {
            self.stand_still(end_ns, Phase::Diverged)?;
        }
        self.report_status(Phase::Finished)?;
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
                        self.stand_still(time_ns, Phase::Paused)?;
                    }
                }
                self.guard(time_ns);
                self.take_sample(time_ns);
                if is_due {
                    self.next_status_ns = time_ns + STATUS_PERIOD_NS;
                    let is_stopped = self.sequencer.is_stopped();
                    self.report_status(if is_stopped { Phase::Stopped } else { Phase::Running })?;
                }
            }
            Event::Deliver(state) => self.deliver(time_ns, state)?,
            Event::Arrive(command) => self.apply(time_ns, &command),
            Event::Load(mass) => self.engine.carry(mass),
            Event::Timeout => self.time_out(time_ns),
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
        for load in &self.scenario.loads {
            self.agenda.push(nanoseconds(load.at), Event::Load(load.mass));
        }
        let mut state = self.measure(0);
        self.set_deadline();
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
            self.report_status(Phase::Waiting)?;
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
        if let (Some(stream), Some(row)) = (&self.stream, self.first_row.take()) {
            stream.push(row, true);
        }
        if let (Answer::Torque, Some(delivered_ns)) = (answer, transit) {
            self.take(Heard::Torque(delivered_ns));
        }
        Ok(())
    }

    /// Stops the arm if a joint has left its limits.
    fn guard(&mut self, time_ns: u64) {
        let truth = self.engine.state();
        let breach = self.sequencer.guard(&truth.position, &truth.velocity, time_ns);
        if let Some((joint, key)) = breach {
            tell_stop(time_ns, joint, key);
        }
    }

    /// Ends the hold if no command has taken effect for too long.
    fn time_out(&mut self, time_ns: u64) {
        let velocity = self.engine.state().velocity;
        self.sequencer.time_out(time_ns, &velocity);
        self.tell_timeout(time_ns);
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
        let Tracked { tip, desired, error } = self.tracking.at(&truth, &self.scenario.trajectory);
        self.measures.sample(time_ns, matrix::squared_norm(&SVector::from(error)));
        let actuator = self.sequencer.actuator();
        if self.trace.is_some() || self.stream.is_some() {
            let row = TraceRow {
                time: time_ns as f64 * 1e-9,
                position: truth.position,
                velocity: truth.velocity,
                tip,
                desired,
                error,
                torque: actuator.torque(time_ns, &truth.velocity),
                echo: actuator.applied(time_ns),
            };
            if time_ns == 0 {
                self.first_row = Some(row); // The run may never begin.
            } else if let Some(stream) = &self.stream {
                stream.push(row, self.clock.stands_still());
            }
            if let Some(trace) = &mut self.trace {
                trace.push(row);
            }
        }
        let (position, velocity) = self.sensor.measure(time_ns, truth.position, truth.velocity);
        self.gravity_terms.note(self.header.sequence, &position);
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
            applied: actuator.applied(time_ns),
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
                    let torque = self.peer.torque();
                    let gravity = self.gravity_terms.of(torque.header.sequence);
                    let command = Command::of(torque, gravity);
                    self.agenda.push(arrives_ns, Event::Arrive(command));
                }
            }
        }
    }

    fn apply(&mut self, time_ns: u64, command: &Command) {
        let velocity = self.engine.state().velocity;
        let before = self.sequencer.actuator().commanded(&velocity);
        if self.sequencer.apply(command, time_ns, &velocity) {
            self.clock.apply(time_ns);
            let torque = self.sequencer.actuator().commanded(&velocity);
            if self.new_law_from.take_if(|first| command.sequence >= *first).is_some() {
                self.tell_step(&before, &torque);
            }
            self.measures.command(&torque);
            self.set_deadline();
        }
    }

    fn set_deadline(&mut self) {
        if let Some(deadline_ns) = self.sequencer.deadline() {
            self.agenda.push(deadline_ns, Event::Timeout);
        }
    }

    /// Lets the run's time stand still at `time_ns` until it is to go on; after a divergence, until a
    /// reset.
    fn stand_still(&mut self, time_ns: u64, phase: Phase) -> Result<(), BusError> {
        let paused = Instant::now();
        while (self.is_paused || phase == Phase::Diverged) && !self.is_reset {
            let (peer, sequencer) = (&mut self.peer, &mut self.sequencer);
            let heard = self.clock.stand_still(peer, sequencer, time_ns, GLANCE)?;
            self.take(heard);
            if !self.peer.may_proceed() {
                self.is_stopped = true;
                break;
            }
            self.report_status(phase)?;
            self.attend(time_ns)?;
        }
        self.clock.resume(paused.elapsed());
        self.next_status_ns = time_ns;
        Ok(())
    }

    fn report_status(&mut self, phase: Phase) -> Result<(), BusError> {
        let truth = self.engine.state();
        let Commands { sent, applied, lost, too_old, late, .. } = self.sequencer.commands();
        let stalls = self.clock.stalls();
        let exchange = self.peer.exchange();
        exchange.report(&StatusSample {
            header: self.header,
            phase: phase as u64,
            sent,
            applied,
            lost,
            too_old,
            late,
            rejected: exchange.rejected(),
            deadline_misses: self.clock.deadline_misses().unwrap_or(0),
            stalls: stalls.count,
            longest_stall_ns: stalls.longest_ns,
            timeouts: self.sequencer.timeouts(),
            takeovers: exchange.takeovers(),
            // An arm that diverged has numbers that no monitor would accept.
            position: finite(truth.position),
            velocity: finite(truth.velocity),
            torque: finite(self.sequencer.actuator().torque(truth.time_ns, &truth.velocity)),
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
        let stalls = self.clock.stalls();
        let report = Report {
            commands: Commands { rejected, ..report.commands },
            takeovers,
            deadline_misses: self.clock.deadline_misses(),
            stalls: stalls.count,
            longest_stall_us: (stalls.count > 0).then_some(stalls.longest_ns as f64 * 1e-3),
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
            reset: self.is_reset.then(|| self.scenario.anew()),
        }
    }
}

/// Zero in place of what is no number.
fn finite(list: Joints) -> Joints {
    list.map(|number| if number.is_finite() { number } else { 0.0 })
}
