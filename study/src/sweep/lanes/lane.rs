//! One loop in its lane, between two motions of its arm: what happens when.
//!
//! This is the plant's agenda where nothing has to wait; the rules are those of the plant's
//! [`Sequencer`]. In lockstep the answer to a state follows from what is known when it is measured,
//! because links do not look at what they carry: whether a state will be overtaken, and when its
//! command arrives, can be drawn in advance. So a sample is answered at once, and only commands are
//! under way.

use std::collections::VecDeque;

use mtj_controller::{
    memory::Memory,
    prediction::{self, Ahead, SentTorques},
    responder::Responder,
};
use mtj_model::{
    arm::planar::{Configuration, PlanarArm},
    scenario::{Jitter, Load, MemoryPolicy, Scenario},
};
use mtj_plant::{
    actuator::Command,
    engine::Drive,
    error::LinkError,
    report::{Measures, Report},
    sensor::Sensor,
    sequencer::{Departure, Sequencer},
};
use mtj_protocol::sample::Joints;
use nalgebra::SVector;

/// The next event of a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// A command takes effect.
    Arrive,
    /// The tip takes up another load.
    Load,
    /// The state is measured.
    Sample,
    /// The run is over.
    End,
}

/// The inputs of the law at a sample.
pub(crate) struct LawInputs<const E: usize> {
    /// The remembered echo; zero at the first sample.
    pub recalled: [f64; E],
    /// How far ahead to aim, s.
    pub horizon: f64,
    /// When the state reaches the controller, ns; `None` if it never does.
    pub delivered_ns: Option<u64>,
}

/// A loop.
pub(crate) struct Lane<'s, const N: usize, const E: usize> {
    /// The number of the scenario, among all.
    pub number: usize,
    /// The scenario.
    pub scenario: &'s Scenario,
    /// The time of the next event, ns.
    pub time_ns: u64,
    /// The next event.
    pub event: Event,
    end_ns: u64,
    /// Number of the newest sample.
    sequence: u64,
    sequencer: Sequencer<N, E>,
    /// Those to come.
    loads: &'s [Load],
    /// Transits of the next states that had to be known before they are measured, ns.
    ahead: VecDeque<Option<u64>>,
    sensor: Sensor,
    memory: Option<Memory<E>>,
    /// What the controller's model of the arm predicts by, and the model.
    model: Option<(SentTorques, PlanarArm<f64, N>)>,
    measures: Measures<N>,
    /// When commands arrive, and the commands, the first first.
    under_way: VecDeque<(u64, Command<N, E>)>,
    /// When states reach the controller that do so later than they were measured, their numbers,
    /// and what happens to their answers then.
    undelivered: VecDeque<(u64, u64, Departure)>,
}

impl<'s, const N: usize, const E: usize> Lane<'s, N, E> {
    /// A loop at its first sample.
    pub(crate) fn new(number: usize, scenario: &'s Scenario) -> Result<Self, LinkError> {
        Ok(Self {
            number,
            scenario,
            time_ns: 0,
            event: Event::Sample,
            end_ns: scenario.duration.as_nanos() as u64,
            sequence: 0,
            sequencer: Sequencer::new(scenario)?,
            loads: &scenario.loads,
            ahead: VecDeque::new(),
            sensor: Sensor::new(scenario),
            memory: scenario.law.has_memory().then(|| Memory::new(&scenario.law.memory)),
            model: (scenario.law.predicts_by_model())
                .then(|| (SentTorques::default(), Responder::of(scenario).arm)),
            measures: Measures::new(scenario),
            under_way: VecDeque::new(),
            undelivered: VecDeque::new(),
        })
    }

    /// Finds the next event; returns the time until then, s.
    #[inline(always)]
    pub(crate) fn look_ahead(&mut self) -> f64 {
        let now = self.time_ns;
        let next_sample_ns = self.sequencer.next_sample_ns();
        (self.time_ns, self.event) = match self.under_way.front() {
            Some((arrives_ns, _)) if *arrives_ns <= next_sample_ns => (*arrives_ns, Event::Arrive),
            _ => (next_sample_ns, Event::Sample),
        };
        if let Some(load) = self.loads.first() {
            let at_ns = load.at.as_nanos() as u64;
            // Commands come first, samples see what is carried.
            if at_ns < self.time_ns || at_ns == self.time_ns && self.event == Event::Sample {
                (self.time_ns, self.event) = (at_ns, Event::Load);
            }
        }
        if self.time_ns >= self.end_ns {
            (self.time_ns, self.event) = (self.end_ns, Event::End);
        }
        (self.time_ns - now) as f64 * 1e-9
    }

    /// Takes in the true joint velocities where the arm has come to, rad/s.
    #[inline(always)]
    pub(crate) fn observe(&mut self, velocity: &[f64; N]) {
        self.sequencer.observe(velocity);
    }

    /// Whether the arm has diverged.
    #[inline(always)]
    pub(crate) fn has_diverged(&self) -> bool {
        self.sequencer.has_diverged()
    }

    /// The load that the tip takes up now, kg.
    pub(crate) fn take_load(&mut self) -> Option<f64> {
        let (load, rest) = self.loads.split_first()?;
        self.loads = rest;
        Some(load.mass)
    }

    /// Puts the next command into effect; returns what acts on the joints then.
    pub(crate) fn arrive(&mut self) -> Option<Drive<N>> {
        let (_, command) = self.under_way.pop_front()?;
        self.apply(&command)
    }

    #[inline(always)]
    fn apply(&mut self, command: &Command<N, E>) -> Option<Drive<N>> {
        // Nothing but a timeout makes the torque depend on the velocity, and there is none here.
        if !self.sequencer.apply(command, self.time_ns, &[0.0; N]) {
            return None;
        }
        let actuator = self.sequencer.actuator();
        self.measures.command(&actuator.commanded(&[0.0; N]));
        Some(*actuator.drive())
    }

    /// Takes in the true tracking error at this sample.
    #[inline(always)]
    pub(crate) fn note_error(&mut self, squared_error: f64) {
        self.measures.sample(self.time_ns, squared_error);
    }

    /// The measured state for a true one, rad and rad/s.
    pub(crate) fn sense(&mut self, position: Joints, velocity: Joints) -> (Joints, Joints) {
        self.sensor.measure(self.time_ns, position, velocity)
    }

    /// Takes a sample.
    #[inline(always)]
    pub(crate) fn sample(&mut self) -> LawInputs<E> {
        self.hand_over_before(self.time_ns + 1);
        self.sequence = self.sequencer.sample(self.time_ns);
        let latency_ns = self.sequencer.actuator().latency_ns();
        let horizon = prediction::horizon(self.scenario.law.prediction, latency_ns);
        let recalled = self.recall();
        let delivered_ns = self.delivery();
        LawInputs {
            recalled: recalled.unwrap_or([0.0; E]),
            horizon: horizon.unwrap_or(0.0),
            delivered_ns,
        }
    }

    /// Where the arm will be a horizon after it was measured now, s, as far as the controller's model
    /// of the arm knows; `None` without a model.
    pub(crate) fn ahead(
        &self,
        horizon: f64,
        position: [f64; N],
        velocity: [f64; N],
    ) -> Option<Ahead<f64, Configuration<f64, N>, N>> {
        let (sent, arm) = self.model.as_ref()?;
        let (position, velocity) = (SVector::from(position), SVector::from(velocity));
        Some(sent.ahead(arm, self.time_ns, horizon, position, velocity))
    }

    #[inline(always)]
    fn recall(&mut self) -> Option<[f64; E]> {
        let memory = self.memory.as_ref()?;
        let delivered = if self.scenario.law.memory.policy == MemoryPolicy::Delivered {
            self.sequencer.delivered(self.time_ns)
        } else {
            [0.0; E]
        };
        memory.recall(&self.sequencer.actuator().applied(self.time_ns), &delivered).copied()
    }

    /// When the state measured now reaches the controller; `None` if it is lost, overtaken, or too
    /// late for this run.
    #[inline(always)]
    fn delivery(&mut self) -> Option<u64> {
        let transit = match self.ahead.pop_front() {
            Some(transit) => transit?,
            None => self.sequencer.state_transit(self.sequence)?,
        };
        let delivered_ns = self.time_ns + transit;
        // The clock starts with the answer to the first.
        let is_heard = self.sequence == 0
            || delivered_ns < self.end_ns && !self.will_be_overtaken(delivered_ns);
        is_heard.then_some(delivered_ns)
    }

    /// Whether a later state reaches the controller before `delivered_ns`, so that the sequencer
    /// would not hand over this one.
    #[inline(always)]
    fn will_be_overtaken(&mut self, delivered_ns: u64) -> bool {
        if self.scenario.link.state.jitter == Jitter::None {
            return false;
        }
        let mut time_ns = self.time_ns;
        for (later, sequence) in (self.sequence + 1..).enumerate() {
            time_ns += self.sequencer.period_ns();
            if time_ns >= delivered_ns {
                break;
            }
            if self.ahead.len() == later {
                self.ahead.push_back(self.sequencer.state_transit(sequence));
            }
            if self.ahead[later].is_some_and(|transit| time_ns + transit < delivered_ns) {
                return true;
            }
        }
        false
    }

    /// Answers the state measured now, which reaches the controller at `delivered_ns`, with a
    /// command. Returns what acts on the joints if it takes effect at once.
    #[inline(always)]
    pub(crate) fn command(
        &mut self,
        delivered_ns: u64,
        torque: [f64; N],
        gravity: [f64; N],
        echo: [f64; E],
    ) -> Option<Drive<N>> {
        if let Some(memory) = &mut self.memory {
            memory.store(self.time_ns, &echo);
        }
        if let Some((sent, _)) = &mut self.model {
            sent.store(self.time_ns, &torque);
        }
        let (sequence, sampled_ns) = (self.sequence, self.time_ns);
        let is_finite = torque.iter().chain(&echo).all(|x| x.is_finite());
        let departure = self.sequencer.depart(delivered_ns, is_finite);
        let mut effect = None;
        if let Departure::Arrives(arrives_ns) = departure {
            let echo_count = E as u64;
            let command = Command { sequence, sampled_ns, torque, gravity, echo, echo_count };
            if arrives_ns == self.time_ns {
                effect = self.apply(&command);
            } else {
                self.send(arrives_ns, command);
            }
        }
        // The first is handed over before the clock starts.
        if delivered_ns > self.time_ns && sequence > 0 {
            self.undelivered.push_back((delivered_ns, sequence, departure));
        } else {
            self.hand_over(sequence, departure);
        }
        effect
    }

    fn send(&mut self, arrives_ns: u64, command: Command<N, E>) {
        let place = self.under_way.iter().rposition(|(other_ns, _)| *other_ns <= arrives_ns);
        self.under_way.insert(place.map_or(0, |place| place + 1), (arrives_ns, command));
    }

    #[inline(always)]
    fn hand_over(&mut self, sequence: u64, departure: Departure) {
        let is_handed_over = self.sequencer.hand_over(sequence);
        debug_assert!(is_handed_over, "an overtaken state is not answered");
        self.sequencer.count(departure);
    }

    /// Hands over what reaches the controller before `time_ns`.
    fn hand_over_before(&mut self, time_ns: u64) {
        while let Some((delivered_ns, sequence, departure)) = self.undelivered.front().copied()
            && delivered_ns < time_ns
        {
            self.undelivered.pop_front();
            self.hand_over(sequence, departure);
        }
    }

    /// The measures of a run that ended with this event, after so much work, J.
    pub(crate) fn report(&mut self, energy: f64) -> Report {
        // At the same instant a state is handed over after commands and before samples.
        self.hand_over_before(self.time_ns + u64::from(self.event == Event::Sample));
        self.measures.report(self.scenario, &self.sequencer, self.time_ns, energy)
    }
}
