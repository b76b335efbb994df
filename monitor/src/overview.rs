//! What is known of a session by now: what every display shows.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::{Duration, Instant},
};

use mtj_model::law::{Description, Signal};
use mtj_protocol::{
    member::Role,
    port::{Message, Offered},
    sample::{
        ChangeSample, ErrorSample, Header, PresenceSample, StateSample, StatusSample, TorqueSample,
    },
};

use crate::durations::RecentDurations;

/// How long a plant or a controller may be quiet before it counts as silent, unless its sample
/// period is long.
const SILENT: Duration = Duration::from_millis(500);
/// How long a role may be quiet that has nothing to do but to say that it is there.
const ABSENT: Duration = Duration::from_millis(2500);
/// How many runs are remembered for telling stragglers.
const RUNS: usize = 16;
/// How many changes are kept.
const CHANGES: usize = 200;

/// The newest of everything.
#[derive(Clone, Default)]
pub struct Overview {
    /// Of the run that is heard.
    pub scenario: Option<Arc<Offered>>,
    /// The newest state.
    pub state: Option<StateSample>,
    /// The newest torque.
    pub torque: Option<TorqueSample>,
    /// The newest error.
    pub error: Option<ErrorSample>,
    /// The newest status.
    pub status: Option<StatusSample>,
    /// What was changed in this run, and what was refused, oldest first.
    pub changes: VecDeque<ChangeSample>,
    /// Round trips of the last seconds.
    pub round_trips: RecentDurations,
    /// Residence in the controller in the last seconds.
    pub residence: RecentDurations,
    /// By how much sample periods lately differed from what they should be.
    pub period_deviation: RecentDurations,
    /// States that this monitor missed in this run.
    pub missed: u64,
    plant: Party,
    controller: Party,
    /// All controllers, by number: who each said it is, and when it was heard last.
    bench: BTreeMap<u64, (PresenceSample, Instant)>,
    run: Option<u64>,
    past: VecDeque<u64>,
}

/// A plant or the controller in charge, as far as it was heard.
#[derive(Clone, Copy, Default)]
pub struct Party {
    /// When it was first heard since it was last silent.
    pub since: Option<Instant>,
    /// When it was heard last.
    pub heard: Option<Instant>,
    /// Who it said it is.
    pub presence: Option<PresenceSample>,
}

/// What should not go unnoticed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alarm {
    /// No plant was ever heard.
    NoPlant,
    /// Nothing was heard of the plant for so long.
    PlantSilent(Duration),
    /// The plant waits for its first controller.
    NoController,
    /// Nothing was heard of the controller for so long, though the plant asks.
    ControllerSilent(Duration),
}

impl Alarm {
    /// In words.
    pub fn sentence(&self) -> String {
        match self {
            Self::NoPlant => "waiting for a plant".to_owned(),
            Self::PlantSilent(silence) => {
                format!("the plant has been silent for {:.1} s", silence.as_secs_f64())
            }
            Self::NoController => "the plant is waiting for a controller".to_owned(),
            Self::ControllerSilent(silence) => {
                format!("the controller has been silent for {:.1} s", silence.as_secs_f64())
            }
        }
    }
}

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// For a controller.
    Waiting,
    /// In motion.
    Running,
    /// At its end.
    Finished,
    /// Stopped for a while.
    Paused,
}

impl Party {
    fn hear(&mut self, patience: Duration) {
        let now = Instant::now();
        if self.heard.is_none_or(|heard| now.duration_since(heard) > patience) {
            self.since = Some(now);
        }
        self.heard = Some(now);
    }

    /// How long it has been silent.
    pub fn silence(&self) -> Option<Duration> {
        self.heard.map(|heard| heard.elapsed())
    }
}

impl Overview {
    /// Takes in one message.
    pub fn hear(&mut self, message: &Message) {
        if self.is_past(message) {
            return;
        }
        let patience = self.patience();
        match message {
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.scenario = Some(Arc::clone(offered));
            }
            Message::State(state) => {
                self.begin(state.header.run);
                self.plant.hear(patience);
                self.hear_state(state);
                self.name_controller();
            }
            Message::Torque(torque) => {
                self.controller.hear(patience);
                self.torque = Some(*torque);
            }
            Message::Error(error) => {
                self.controller.hear(patience);
                self.error = Some(*error);
            }
            Message::Status(status) => {
                self.begin(status.header.run);
                self.plant.hear(patience);
                self.status = Some(*status);
            }
            Message::Change(change) if self.knows(change) => {}
            Message::Change(change) => {
                if self.changes.len() == CHANGES {
                    self.changes.pop_front();
                }
                self.changes.push_back(*change);
            }
            Message::Presence(presence) if presence.role == Role::Plant as u64 => {
                self.plant.hear(ABSENT);
                self.plant.presence = Some(*presence);
            }
            Message::Presence(presence) => {
                let now = Instant::now();
                self.bench.retain(|_, (_, heard)| now.duration_since(*heard) < ABSENT);
                self.bench.insert(presence.id, (*presence, now));
                if self.leader().is_none_or(|leader| leader == presence.id) {
                    self.controller.hear(ABSENT);
                }
                self.name_controller();
            }
            Message::Request(_) => {}
        }
    }

    /// Forgets the last run if this is another one.
    fn begin(&mut self, run: u64) {
        if self.run == Some(run) {
            return;
        }
        let mut past = std::mem::take(&mut self.past);
        past.extend(self.run);
        past.drain(..past.len().saturating_sub(RUNS));
        let (plant, controller) = (self.plant, self.controller);
        let bench = std::mem::take(&mut self.bench);
        *self = Self { plant, controller, bench, past, run: Some(run), ..Self::default() };
    }

    /// The controller is the one that the plant has put in charge; before that, any.
    fn name_controller(&mut self) {
        let leader = match self.leader() {
            Some(leader) => self.bench.get(&leader),
            None => self.bench.values().next(),
        };
        self.controller.presence = leader.map(|(presence, _)| *presence);
    }

    /// Whether a message belongs to a run that is over: its last samples may come after the first ones
    /// of the next run.
    pub fn is_past(&self, message: &Message) -> bool {
        run_and_time(message).is_some_and(|(run, _)| self.past.contains(&run))
    }

    /// Whether a change was heard before: a plant that is asked twice answers twice.
    pub fn knows(&self, change: &ChangeSample) -> bool {
        self.changes.iter().any(|known| known.request == change.request)
    }

    fn hear_state(&mut self, state: &StateSample) {
        if let Some(before) = &self.state {
            let steps = state.header.sequence.saturating_sub(before.header.sequence);
            self.missed = self.missed.saturating_add(steps.saturating_sub(1));
            if steps > 0 && tells_of_another_torque(before, state) {
                self.round_trips.record(state.round_trip_ns);
                self.residence.record(state.residence_ns);
            }
            if steps == 1
                && let Some(deviation) = period_deviation_ns(before, state)
            {
                self.period_deviation.record(deviation.unsigned_abs());
            }
        }
        self.state = Some(*state);
    }

    /// The run's time, s.
    pub fn time(&self) -> f64 {
        self.header().map_or(0.0, |header| header.time_ns as f64 * 1e-9)
    }

    /// Of the newest state or status.
    pub fn header(&self) -> Option<Header> {
        let state = self.state.map(|state| state.header);
        state.or(self.status.map(|status| status.header))
    }

    /// The law that answers or, before the first answer, that is to answer; `None` for a law that
    /// this program does not have.
    pub fn law(&self) -> Option<&'static Description> {
        match &self.error {
            Some(error) => error.description(),
            None => Some(self.scenario.as_ref()?.scenario.law.law.description()),
        }
    }

    /// Where the run is; `None` if no plant was heard.
    pub fn phase(&self) -> Option<Phase> {
        let phases = [Phase::Waiting, Phase::Running, Phase::Finished, Phase::Paused];
        phases.get(self.status.as_ref()?.phase as usize).copied()
    }

    /// The plant.
    pub fn plant(&self) -> &Party {
        &self.plant
    }

    /// The controller.
    pub fn controller(&self) -> &Party {
        &self.controller
    }

    /// The number of the controller that is in charge.
    pub fn leader(&self) -> Option<u64> {
        self.state.and_then(|state| state.leader())
    }

    /// How many other controllers stand by for it.
    pub fn standing_by(&self) -> usize {
        let others = self
            .bench
            .iter()
            .filter(|(id, (_, heard))| Some(**id) != self.leader() && heard.elapsed() < ABSENT);
        if self.leader().is_some() { others.count() } else { 0 }
    }

    /// What should not go unnoticed now, the most important one.
    pub fn alarm(&self) -> Option<Alarm> {
        let Some(silence) = self.plant.silence() else { return Some(Alarm::NoPlant) };
        if self.phase() == Some(Phase::Finished) {
            return None;
        }
        if silence > self.patience() {
            return Some(Alarm::PlantSilent(silence));
        }
        if self.phase() == Some(Phase::Waiting) {
            return Some(Alarm::NoController);
        }
        let patience = if self.phase() == Some(Phase::Paused) { ABSENT } else { self.patience() };
        let silence = self.controller.silence()?;
        (silence > patience).then_some(Alarm::ControllerSilent(silence))
    }

    fn patience(&self) -> Duration {
        let period = self.scenario.as_ref().map(|offered| offered.scenario.timing.sample_period);
        SILENT.max(3 * period.unwrap_or_default())
    }
}

/// The signal that is shown where there is room for one: the first that has a range.
pub(crate) fn gauge(law: &Description) -> Option<&'static Signal> {
    law.signals.iter().find(|signal| signal.range.is_some())
}

/// Which run a message is about, and when in it.
pub fn run_and_time(message: &Message) -> Option<(u64, u64)> {
    let header = match message {
        Message::Scenario(offered) => return Some((offered.run, 0)),
        Message::State(state) => &state.header,
        Message::Torque(torque) => &torque.header,
        Message::Error(error) => &error.header,
        Message::Status(status) => &status.header,
        Message::Change(change) => &change.header,
        Message::Presence(_) | Message::Request(_) => return None,
    };
    Some((header.run, header.time_ns))
}

/// Whether a torque came between two states. A state tells of the one received last; where none came, it
/// repeats itself, and no two take the same time to the nanosecond.
pub fn tells_of_another_torque(before: &StateSample, state: &StateSample) -> bool {
    let times = |state: &StateSample| (state.round_trip_ns, state.residence_ns);
    times(state) != times(before)
}

/// By how much the time between two successive states, as sent, differs from the sample period, ns.
pub fn period_deviation_ns(before: &StateSample, state: &StateSample) -> Option<i64> {
    let is_next = state.header.run == before.header.run
        && Some(state.header.sequence) == before.header.sequence.checked_add(1);
    let since = |ns: u64, before: u64| ns.wrapping_sub(before) as i64;
    let period = since(state.header.time_ns, before.header.time_ns);
    // Sequence 0 is repeated until a controller answers; its stamp is of the last time.
    (is_next && before.header.sequence > 0)
        .then(|| since(state.sent_ns, before.sent_ns).wrapping_sub(period))
}
