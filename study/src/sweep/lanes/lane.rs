//! One loop in its lane, between two motions of its arm: what happens when, and what is counted.
//!
//! This is the plant's agenda where nothing has to wait. In lockstep the answer to a state follows from
//! what is known when it is measured, because links do not look at what they carry: whether a state will
//! be overtaken, and when its command arrives, can be drawn in advance. So a sample is answered at once,
//! and only commands are under way.

use std::collections::VecDeque;

use mtj_controller::{memory::Memory, prediction};
use mtj_model::scenario::{Jitter, MemoryPolicy, Scenario};
use mtj_plant::{
    actuator::Actuator,
    ledger::{Commands, Ledger},
    link::{Direction, Link},
    report::{Measures, Report},
    sensor::Sensor,
};
use mtj_protocol::{bus::BusError, sample::Joints};
use nalgebra::SVector;

/// What comes next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A command takes effect.
    Arrive,
    /// The state is measured.
    Sample,
    /// The run is over.
    End,
}

/// What became of a state that was handed to the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    UnderWay,
    Lost,
    Rejected,
}

/// A command on its way.
#[derive(Clone, Copy, Debug)]
struct Command<const N: usize, const E: usize> {
    arrives_ns: u64,
    sequence: u64,
    sampled_ns: u64,
    torque: [f64; N],
    echo: [f64; E],
}

/// What a sample gives the law.
pub struct Sample<const E: usize> {
    /// The remembered echo; zero at the first sample.
    pub recalled: SVector<f64, E>,
    /// How far ahead to aim, s.
    pub horizon: f64,
    /// When the state reaches the controller, ns; `None` if it never does.
    pub delivered_ns: Option<u64>,
}

/// A loop.
pub struct Lane<'s, const N: usize, const E: usize> {
    /// Of the scenario, among all.
    pub number: usize,
    /// The scenario.
    pub scenario: &'s Scenario,
    /// When the event is that the arm moves to, ns.
    pub time_ns: u64,
    /// What happens there.
    pub event: Event,
    /// Whether the arm ran away.
    pub diverged: bool,
    period_ns: u64,
    end_ns: u64,
    sequence: u64,
    next_sample_ns: u64,
    state_link: Link,
    /// Transits of the next states that had to be known before they are measured, ns.
    ahead: VecDeque<Option<u64>>,
    torque_link: Link,
    sensor: Sensor,
    actuator: Actuator<N, E>,
    memory: Option<Memory<E>>,
    measures: Measures<N>,
    commands: Commands,
    /// Commands and when they arrive, the first first.
    under_way: VecDeque<Command<N, E>>,
    /// States that reach the controller later than they were measured, and when.
    undelivered: VecDeque<(u64, Fate)>,
}

impl<'s, const N: usize, const E: usize> Lane<'s, N, E> {
    /// A loop at its first sample.
    pub fn new(number: usize, scenario: &'s Scenario) -> Result<Self, BusError> {
        Ok(Self {
            number,
            scenario,
            time_ns: 0,
            event: Event::Sample,
            diverged: false,
            period_ns: scenario.timing.sample_period.as_nanos() as u64,
            end_ns: scenario.duration.as_nanos() as u64,
            sequence: 0,
            next_sample_ns: 0,
            state_link: Link::new(&scenario.link.state, Direction::State, scenario.seed)?,
            ahead: VecDeque::new(),
            torque_link: Link::new(&scenario.link.torque, Direction::Torque, scenario.seed)?,
            sensor: Sensor::new(scenario.noise, scenario.seed),
            actuator: Actuator::new(scenario),
            memory: scenario.law.has_memory().then(|| Memory::new(&scenario.law.memory)),
            measures: Measures::new(scenario),
            commands: Commands::default(),
            under_way: VecDeque::new(),
            undelivered: VecDeque::new(),
        })
    }

    /// Looks for the next event; returns how far it is, s.
    #[inline(always)]
    pub fn look_ahead(&mut self) -> f64 {
        let now = self.time_ns;
        (self.time_ns, self.event) = match self.under_way.front() {
            Some(command) if command.arrives_ns <= self.next_sample_ns => {
                (command.arrives_ns, Event::Arrive)
            }
            _ => (self.next_sample_ns, Event::Sample),
        };
        if self.time_ns >= self.end_ns {
            (self.time_ns, self.event) = (self.end_ns, Event::End);
        }
        (self.time_ns - now) as f64 * 1e-9
    }

    /// Puts the next command into effect; returns the torque.
    pub fn arrive(&mut self) -> Option<[f64; N]> {
        let command = self.under_way.pop_front()?;
        self.apply(&command)
    }

    #[inline(always)]
    fn apply(&mut self, command: &Command<N, E>) -> Option<[f64; N]> {
        let Command { sequence, sampled_ns, torque, echo, .. } = command;
        if !self.actuator.hold(*sequence, *sampled_ns, torque, echo, self.time_ns) {
            self.commands.lost += 1;
            return None;
        }
        self.commands.applied += 1;
        // Nothing but a timeout makes the torque depend on the velocity, and there is none here.
        let torque = self.actuator.torque(&[0.0; N]);
        self.measures.command(&torque);
        Some(torque)
    }

    /// Takes in the true tracking error at this sample.
    #[inline(always)]
    pub fn note_error(&mut self, squared_error: f64) {
        self.measures.sample(self.time_ns, squared_error);
    }

    /// What a sensor makes of a state, rad and rad/s.
    pub fn sense(&mut self, position: Joints, velocity: Joints) -> (Joints, Joints) {
        self.sensor.measure(position, velocity)
    }

    /// Takes a sample.
    #[inline(always)]
    pub fn sample(&mut self) -> Sample<E> {
        self.count_delivered(self.time_ns + 1);
        let horizon = prediction::horizon(self.scenario.law.prediction, self.actuator.latency_ns());
        let recalled = self.recall();
        let delivered_ns = self.delivery();
        self.next_sample_ns = self.time_ns + self.period_ns;
        Sample {
            recalled: recalled.unwrap_or(SVector::zeros()),
            horizon: horizon.unwrap_or(0.0),
            delivered_ns,
        }
    }

    #[inline(always)]
    fn recall(&mut self) -> Option<SVector<f64, E>> {
        let memory = self.memory.as_ref()?;
        let settings = &self.scenario.law.memory;
        let delivered = if settings.policy == MemoryPolicy::Delivered {
            self.actuator.delivered(self.time_ns, settings.step.as_nanos() as u64)
        } else {
            [0.0; E]
        };
        memory.recall(|| self.actuator.applied().into(), || delivered.into())
    }

    /// When the state measured now reaches the controller; `None` if it is lost, overtaken, or too late
    /// for this run.
    #[inline(always)]
    fn delivery(&mut self) -> Option<u64> {
        if self.sequence == 0 {
            // The two must meet, so the first state is not lost; it may be late.
            let transit = self.state_link.transit().unwrap_or(self.scenario.link.state.latency);
            return Some(transit.as_nanos() as u64);
        }
        let transit = self.ahead.pop_front().unwrap_or_else(|| transit_ns(&mut self.state_link))?;
        let delivered_ns = self.time_ns + transit;
        (delivered_ns < self.end_ns && !self.is_overtaken(delivered_ns)).then_some(delivered_ns)
    }

    /// Whether a later state reaches the controller before `delivered_ns`.
    #[inline(always)]
    fn is_overtaken(&mut self, delivered_ns: u64) -> bool {
        if self.scenario.link.state.jitter == Jitter::None {
            return false;
        }
        let mut time_ns = self.time_ns;
        for later in 0.. {
            time_ns += self.period_ns;
            if time_ns >= delivered_ns {
                break;
            }
            if self.ahead.len() == later {
                self.ahead.push_back(transit_ns(&mut self.state_link));
            }
            if self.ahead[later].is_some_and(|transit| time_ns + transit < delivered_ns) {
                return true;
            }
        }
        false
    }

    /// Answers the state measured now, which reaches the controller at `delivered_ns`, with a command.
    /// Returns the torque if it takes effect at once.
    #[inline(always)]
    pub fn command(
        &mut self,
        delivered_ns: u64,
        torque: [f64; N],
        echo: [f64; E],
    ) -> Option<[f64; N]> {
        if let Some(memory) = &mut self.memory {
            memory.store(self.time_ns, &echo.into());
        }
        let is_finite = torque.iter().chain(&echo).all(|x| x.is_finite());
        let (mut fate, mut effect) = (Fate::UnderWay, None);
        if !is_finite {
            fate = Fate::Rejected;
        } else if let Some(transit) = transit_ns(&mut self.torque_link) {
            let (sequence, sampled_ns) = (self.sequence, self.time_ns);
            let arrives_ns = delivered_ns + transit;
            let command = Command { arrives_ns, sequence, sampled_ns, torque, echo };
            if arrives_ns == self.time_ns {
                effect = self.apply(&command);
            } else {
                self.send(command);
            }
        } else {
            fate = Fate::Lost;
        }
        if delivered_ns > self.time_ns && self.sequence > 0 {
            self.undelivered.push_back((delivered_ns, fate));
        } else {
            self.count(fate);
        }
        effect
    }

    fn send(&mut self, command: Command<N, E>) {
        let is_before = |other: &Command<N, E>| other.arrives_ns <= command.arrives_ns;
        let place = self.under_way.iter().rposition(is_before);
        self.under_way.insert(place.map_or(0, |place| place + 1), command);
    }

    /// The state measured now was answered, or never will be.
    #[inline(always)]
    pub fn end_sample(&mut self) {
        self.sequence += 1;
    }

    #[inline(always)]
    fn count(&mut self, fate: Fate) {
        self.commands.sent += 1;
        match fate {
            Fate::UnderWay => {}
            Fate::Lost => self.commands.lost += 1,
            Fate::Rejected => self.commands.rejected += 1,
        }
    }

    /// Counts what reached the controller before `time_ns`.
    fn count_delivered(&mut self, time_ns: u64) {
        while let Some((delivered_ns, fate)) = self.undelivered.front().copied()
            && delivered_ns < time_ns
        {
            self.undelivered.pop_front();
            self.count(fate);
        }
    }

    /// The measures of a run that ended with this event, after so much work, J.
    pub fn report(&mut self, energy: f64, ledger: &mut Ledger) -> Report {
        // At the same instant a state is handed over after commands and before samples.
        self.count_delivered(self.time_ns + u64::from(self.event == Event::Sample));
        ledger.commands = self.commands;
        self.measures.report(self.scenario, self.time_ns, energy, self.diverged, ledger, 0)
    }
}

fn transit_ns(link: &mut Link) -> Option<u64> {
    link.transit().map(|transit| transit.as_nanos() as u64)
}
