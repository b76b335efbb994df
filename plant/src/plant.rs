//! The loop of the plant: one queue of events, and a clock that says what waiting means.

use std::time::{Duration, Instant};

use mtj_model::scenario::{ClockKind, Scenario};
use mtj_protocol::{
    bus::BusError,
    port::{Answer, Exchange},
    sample::{Header, StateSample, StatusSample, TorqueSample, VERSION},
};

use crate::{
    actuator::Actuator,
    agenda::{Agenda, Event},
    clock::{self, Clock},
    durations::Durations,
    knobs::Knobs,
    ledger::Ledger,
    link::{Direction, Link},
    report::{Measures, Report},
    sensor::Sensor,
    simulator::{Simulator, simulator},
    trace::Row,
};

/// How often to repeat the first state until a controller answers it.
const RENDEZVOUS: Duration = Duration::from_millis(20);
/// How often to repeat a later state in lockstep, in case the controller was replaced.
const REPEAT: Duration = Duration::from_millis(200);
/// How often to look whether to go on.
const PATIENCE: Duration = Duration::from_millis(100);
/// For how many samples of a trace there is room from the beginning; a longer one grows.
const TRACED: u128 = 1 << 20;
/// How often monitors are told the truth, in the run's time, ns.
const STATUS_PERIOD_NS: u64 = 20_000_000;

/// A run's outcome.
pub struct Outcome {
    /// Its measures.
    pub report: Report,
    /// Every sampling instant, if asked for.
    pub trace: Vec<Row>,
    /// All round trips, if asked for.
    pub round_trips: Durations,
    /// Whether the run was stopped before its end.
    pub interrupted: bool,
    /// The scenario of the run that was asked for instead of this one's end.
    pub reset: Option<Scenario>,
}

/// How a run is watched.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    /// Keep a [`Row`] for each sampling instant.
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
) -> Result<Outcome, BusError> {
    let mut plant = Plant::new(scenario, run, exchange, watch, proceed)?;
    plant.run()?;
    Ok(plant.outcome())
}

pub(crate) struct Plant<'a> {
    /// As it is by now: knobs change it.
    pub(crate) scenario: Scenario,
    pub(crate) exchange: &'a mut dyn Exchange,
    watch: Watch,
    pub(crate) proceed: &'a dyn Fn() -> bool,
    /// Of the newest sample.
    pub(crate) header: Header,
    pub(crate) simulator: Box<dyn Simulator>,
    pub(crate) agenda: Agenda,
    pub(crate) sensor: Sensor,
    pub(crate) state_link: Link,
    pub(crate) torque_link: Link,
    pub(crate) actuator: Actuator,
    pub(crate) clock: Clock,
    pub(crate) knobs: Knobs,
    /// Sequence number of the newest state that was handed to the controller.
    delivered: Option<u64>,
    ledger: Ledger,
    pub(crate) next_status_ns: u64,
    measures: Measures,
    trace: Vec<Row>,
    diverged: bool,
    pub(crate) stopped: bool,
}

impl<'a> Plant<'a> {
    fn new(
        scenario: &'a Scenario,
        run: u64,
        exchange: &'a mut dyn Exchange,
        watch: Watch,
        proceed: &'a dyn Fn() -> bool,
    ) -> Result<Self, BusError> {
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
            exchange,
            watch,
            proceed,
            header,
            simulator: simulator(scenario),
            agenda: Agenda::new(),
            sensor: Sensor::new(scenario.noise, scenario.seed),
            state_link: Link::new(&scenario.link.state, Direction::State, scenario.seed)?,
            torque_link: Link::new(&scenario.link.torque, Direction::Torque, scenario.seed)?,
            actuator: Actuator::new(scenario),
            clock: Clock::start(),
            knobs: Knobs::default(),
            delivered: None,
            ledger: Ledger::new(),
            next_status_ns: 0,
            measures: Measures::new(scenario),
            trace: Vec::with_capacity(if watch.trace { samples.min(TRACED) as usize } else { 0 }),
            diverged: false,
            stopped: false,
        })
    }

    pub(crate) fn is_realtime(&self) -> bool {
        self.scenario.timing.clock == ClockKind::Realtime
    }

    /// Pops events in order of time until the run's duration is over.
    fn run(&mut self) -> Result<(), BusError> {
        let end_ns = nanoseconds(self.scenario.duration);
        if self.is_realtime() {
            clock::wake_punctually();
        }
        self.meet_controller()?;
        while !self.stopped && !self.diverged && !self.knobs.is_reset {
            let next = self.agenda.next_time().filter(|time| *time < end_ns).unwrap_or(end_ns);
            if self.is_realtime() && self.listen_until(next)? {
                continue; // Something came that may be due earlier.
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
        self.ledger.settle(self.simulator.time_ns(), self.scenario.timing.sample_period);
        self.report_status(2)
    }

    pub(crate) fn advance(&mut self, time_ns: u64) {
        self.simulator.advance(time_ns, self.actuator.drive());
        self.diverged = self.simulator.has_diverged();
    }

    fn handle(&mut self, time_ns: u64, event: Event) -> Result<(), BusError> {
        match event {
            Event::Sample => {
                let is_due = time_ns >= self.next_status_ns;
                if is_due {
                    self.attend(time_ns)?;
                    if self.knobs.is_paused {
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
            Event::Timeout(commands) => {
                if commands == self.actuator.commands() {
                    self.ledger.timeouts += 1;
                    self.actuator.time_out(time_ns);
                }
            }
            Event::Calm(kick) => self.calm(kick),
        }
        Ok(())
    }

    /// Takes the first sample and repeats it until a controller answers; then the clock starts, with
    /// that answer in hand.
    fn meet_controller(&mut self) -> Result<(), BusError> {
        self.header.sequence = 0;
        let mut state = self.measure(0);
        self.agenda.push(nanoseconds(self.scenario.timing.sample_period), Event::Sample);
        if let Some(timeout) = self.scenario.safety.command_timeout {
            self.agenda.push(nanoseconds(timeout), Event::Timeout(0));
        }
        // The two must meet, so the first state is not lost; it may be late.
        let there = self.state_link.transit().unwrap_or(self.scenario.link.state.latency);
        self.delivered = Some(0);
        self.ledger.commands.sent += 1;
        let started = Instant::now();
        let mut complained = false;
        let answer = loop {
            if let Some(answer) = self.ask(&mut state, RENDEZVOUS)? {
                break answer;
            }
            if !(self.proceed)() {
                self.stopped = true;
                return Ok(());
            }
            self.report_status(0)?;
            self.attend(0)?;
            if self.knobs.is_reset {
                return Ok(());
            }
            if !complained && started.elapsed() > Duration::from_secs(2) {
                complained = true;
                eprintln!(
                    "mtj plant: waiting for a controller in session '{}' on {}",
                    self.scenario.bus.session,
                    self.scenario.bus.kind.name()
                );
            }
        };
        self.clock = Clock::start();
        if answer == Answer::Torque {
            self.note_round_trip();
            self.schedule(nanoseconds(there));
        }
        Ok(())
    }

    /// Measures the state, and sends it on its way.
    fn take_sample(&mut self, time_ns: u64) {
        let period = nanoseconds(self.scenario.timing.sample_period);
        if self.is_realtime() && self.clock.now_ns() > time_ns + period {
            self.ledger.deadline_misses += 1;
        }
        self.header.sequence += 1;
        let state = self.measure(time_ns);
        self.agenda.push(time_ns + period, Event::Sample);
        if let Some(transit) = self.state_link.transit() {
            self.agenda.push(time_ns + nanoseconds(transit), Event::Deliver(state));
        }
    }

    fn measure(&mut self, time_ns: u64) -> StateSample {
        self.header.time_ns = time_ns;
        let (tip, _) = self.simulator.tip();
        let time = time_ns as f64 * 1e-9;
        let desired = self.scenario.trajectory.at::<2>(time).point;
        self.measures.sample(time_ns, (desired - tip).norm_squared());
        let (true_position, true_velocity) = (self.simulator.position(), self.simulator.velocity());
        if self.watch.trace {
            self.trace.push(Row {
                time,
                position: true_position,
                velocity: true_velocity,
                tip: tip.into(),
                desired: desired.into(),
                torque: self.actuator.torque(&true_velocity),
                echo: self.actuator.applied(),
            });
        }
        let (position, velocity) = self.sensor.measure(true_position, true_velocity);
        StateSample {
            header: self.header,
            sent_ns: 0,
            latency_ns: self.actuator.latency_ns(),
            round_trip_ns: self.ledger.round_trip_ns,
            residence_ns: self.ledger.residence_ns,
            leader: 0,
            timed_out: u64::from(self.actuator.has_timed_out()),
            echo_count: self.actuator.echo_count(),
            position,
            velocity,
            applied: self.actuator.applied(),
            delivered: self.actuator.delivered(time_ns, nanoseconds(self.scenario.law.memory.step)),
        }
    }

    /// Hands a state to the controller, unless a newer one has overtaken it; in lockstep also waits
    /// for the answer.
    fn deliver(&mut self, time_ns: u64, mut state: StateSample) -> Result<(), BusError> {
        if self.delivered >= Some(state.header.sequence) {
            return Ok(());
        }
        self.delivered = Some(state.header.sequence);
        self.ledger.commands.sent += 1;
        if self.is_realtime() {
            self.ledger.ask(state.header.sequence);
            state.sent_ns = self.ledger.stopwatch.now_ns();
            return self.exchange.send(&mut state);
        }
        loop {
            if let Some(answer) = self.ask(&mut state, REPEAT)? {
                if answer == Answer::Torque {
                    self.note_round_trip();
                    self.schedule(time_ns);
                }
                return Ok(());
            }
            if !(self.proceed)() {
                self.stopped = true;
                return Ok(());
            }
        }
    }

    /// Sends a state and waits for the answer to it.
    fn ask(
        &mut self,
        state: &mut StateSample,
        patience: Duration,
    ) -> Result<Option<Answer>, BusError> {
        if !self.watch.round_trips {
            self.exchange.send(state)?;
            return self.exchange.receive(self.clock.instant(0));
        }
        state.sent_ns = self.ledger.stopwatch.now_ns();
        self.exchange.send(state)?;
        let until = Instant::now() + patience;
        while let Some(answer) = self.exchange.receive(until)? {
            if self.exchange.torque().header.sequence == state.header.sequence {
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }

    /// In real time, lets `time_ns` come while torques are received; true if one was.
    fn listen_until(&mut self, time_ns: u64) -> Result<bool, BusError> {
        let until = self.clock.instant(time_ns);
        loop {
            let patience = until.min(Instant::now() + PATIENCE);
            if self.exchange.receive(patience)? == Some(Answer::Torque) {
                self.note_answer();
                self.schedule(self.clock.now_ns());
                return Ok(true);
            }
            if !(self.proceed)() {
                self.stopped = true;
                return Ok(true);
            }
            if Instant::now() >= until {
                return Ok(false);
            }
        }
    }

    /// Puts the answer that came at `time_ns` on the torque link.
    pub(crate) fn schedule(&mut self, time_ns: u64) {
        if let Some(transit) = self.torque_link.transit() {
            let command = Event::Arrive(*self.exchange.torque());
            self.agenda.push(time_ns + nanoseconds(transit), command);
        } else {
            self.ledger.commands.lost += 1;
        }
    }

    /// Puts a command into effect, unless a newer one has overtaken it, or it is so old that the arm had
    /// to be made safe: what was under way when a link broke is not for now.
    fn apply(&mut self, time_ns: u64, command: &TorqueSample) {
        let age = Duration::from_nanos(time_ns.saturating_sub(command.header.time_ns));
        let is_too_old = self.scenario.safety.command_timeout.is_some_and(|timeout| age > timeout);
        if is_too_old || !self.actuator.apply(command, time_ns) {
            self.ledger.commands.lost += 1;
            return;
        }
        self.ledger.apply(time_ns);
        self.measures.command(&self.actuator.torque(&self.simulator.velocity()));
        if let Some(timeout) = self.scenario.safety.command_timeout {
            let event = Event::Timeout(self.actuator.commands());
            self.agenda.push(time_ns + nanoseconds(timeout), event);
        }
    }

    fn note_round_trip(&mut self) {
        if self.watch.round_trips {
            self.ledger.note_round_trip(self.exchange.torque());
        }
    }

    /// In real time: books an answer.
    pub(crate) fn note_answer(&mut self) {
        self.note_round_trip();
        let answered = self.exchange.torque().header.sequence;
        self.ledger.answer(answered, self.scenario.timing.sample_period);
    }

    pub(crate) fn report_status(&mut self, phase: u64) -> Result<(), BusError> {
        let velocity = self.simulator.velocity();
        let Ledger { commands, deadline_misses, timeouts, .. } = &self.ledger;
        self.exchange.report(&StatusSample {
            header: self.header,
            phase,
            sent: commands.sent,
            applied: commands.applied,
            lost: commands.lost,
            late: commands.late,
            rejected: self.exchange.rejected(),
            deadline_misses: *deadline_misses,
            timeouts: *timeouts,
            takeovers: self.exchange.takeovers(),
            position: self.simulator.position(),
            velocity,
            torque: self.actuator.torque(&velocity),
        })
    }

    fn outcome(mut self) -> Outcome {
        self.ledger.commands.rejected = self.exchange.rejected();
        let report = self.measures.report(
            &self.scenario,
            self.simulator.time_ns(),
            self.simulator.energy(),
            self.diverged,
            &self.ledger,
            self.exchange.takeovers(),
        );
        Outcome {
            report,
            trace: self.trace,
            round_trips: self.ledger.round_trips,
            interrupted: self.stopped,
            reset: self.knobs.is_reset.then_some(self.scenario),
        }
    }
}

pub(crate) fn nanoseconds(duration: Duration) -> u64 {
    duration.as_nanos() as u64
}
