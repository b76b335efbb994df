//! What is known of a session: the same for all displays.

use std::{
    collections::{BTreeMap, VecDeque},
    sync::Arc,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
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

/// A plant or a controller without a sample for this long, or for three sample periods, is silent.
const SILENT: Duration = Duration::from_millis(500);
/// A role without a presence sample for this long is gone.
const ABSENT: Duration = Duration::from_millis(2500);
/// How many past runs are remembered, to reject their late samples.
const RUNS: usize = 16;
/// How many changes are kept.
const CHANGES: usize = 200;

/// The newest message of each kind, and statistics of the last seconds.
#[derive(Clone, Debug, Default)]
pub struct Overview {
    /// The scenario of the current run.
    pub scenario: Option<Arc<Offered>>,
    /// The newest state.
    pub state: Option<StateSample>,
    /// The newest torque.
    pub torque: Option<TorqueSample>,
    /// The newest error.
    pub error: Option<ErrorSample>,
    /// The newest status.
    pub status: Option<StatusSample>,
    /// Accepted and refused changes of this run, oldest first.
    pub changes: VecDeque<ChangeSample>,
    /// Round trips of the last ten seconds.
    pub round_trips: RecentDurations,
    /// Time spent in the controller, over the last ten seconds.
    pub residence: RecentDurations,
    /// Deviation of the measured sample periods from the nominal one, over the last ten seconds.
    pub period_deviation: RecentDurations,
    /// How many states of this run did not reach this monitor.
    pub missed: u64,
    plant: RoleStatus,
    controller: RoleStatus,
    /// The newest presence of each controller by its id, and when it came.
    controllers: BTreeMap<u64, (PresenceSample, Instant)>,
    run: Option<u64>,
    past_runs: VecDeque<u64>,
    /// Whether this monitor was there before the run.
    saw_previous_run: bool,
    joined: Option<Joined>,
}

/// When a monitor joined a run that had begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Joined {
    /// The run's time, ns.
    pub time_ns: u64,
    /// How many times the scenario had been changed before.
    pub missed_changes: u32,
}

impl Joined {
    /// What is not known, for the end of a list of changes.
    pub fn words(&self) -> String {
        match self.missed_changes {
            0 => "monitor joined".to_owned(),
            1 => "monitor joined after 1 change".to_owned(),
            count => format!("monitor joined after {count} changes"),
        }
    }
}

/// What is known of the plant or of the leading controller.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoleStatus {
    /// When its newest message came.
    pub last_heard: Option<Instant>,
    /// When its first message came since it was last silent.
    since: Option<Instant>,
    /// Its newest presence sample: process, machine and when it joined.
    pub presence: Option<PresenceSample>,
}

/// A condition that every display points out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alarm {
    /// No message of a plant has come yet.
    NoPlant,
    /// No message of the plant has come for this long.
    PlantSilent(Duration),
    /// The plant waits for its first controller.
    NoController,
    /// No message of the controller has come for this long, though the plant sends states.
    ControllerSilent(Duration),
}

impl Alarm {
    /// The alarm as a sentence for the user.
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

/// The phase of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// The plant waits for a controller.
    Waiting,
    /// The arm moves.
    Running,
    /// The run is over.
    Finished,
    /// An operator paused the run.
    Paused,
}

impl Phase {
    /// The phase in one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Waiting => "waiting",
            Self::Running => "running",
            Self::Finished => "finished",
            Self::Paused => "paused",
        }
    }
}

impl RoleStatus {
    /// Notes that a message came; a pause longer than `silence_limit` counts as an interruption.
    fn note_message(&mut self, silence_limit: Duration) {
        let now = Instant::now();
        if self.last_heard.is_none_or(|heard| now.duration_since(heard) > silence_limit) {
            self.since = Some(now);
        }
        self.last_heard = Some(now);
    }

    /// How long it has taken part: since it joined, by its own clock, or since its first message if
    /// that is longer ago.
    pub fn age(&self) -> Option<Duration> {
        let observed = self.since?.elapsed();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let joined = self.presence.map(|presence| Duration::from_nanos(presence.since_ns));
        let by_its_clock = joined.and_then(|joined| now.checked_sub(joined));
        Some(by_its_clock.map_or(observed, |age| age.max(observed)))
    }

    /// The time since its newest message.
    pub fn silence(&self) -> Option<Duration> {
        self.last_heard.map(|heard| heard.elapsed())
    }
}

impl Overview {
    /// Takes one message.
    pub fn handle(&mut self, message: &Message) {
        if self.is_from_past_run(message) {
            return;
        }
        let silence_limit = self.silence_limit();
        match message {
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.scenario = Some(Arc::clone(offered));
            }
            Message::State(state) => {
                self.begin(state.header.run);
                self.note_first(&state.header);
                self.plant.note_message(silence_limit);
                self.handle_state(state);
                self.identify_controller();
            }
            Message::Torque(torque) => {
                self.controller.note_message(silence_limit);
                self.torque = Some(*torque);
            }
            Message::Error(error) => {
                self.controller.note_message(silence_limit);
                self.error = Some(*error);
            }
            Message::Status(status) => {
                self.begin(status.header.run);
                self.note_first(&status.header);
                self.plant.note_message(silence_limit);
                self.status = Some(*status);
            }
            Message::Change(change) if self.is_known(change) => {}
            Message::Change(change) => {
                if self.changes.len() == CHANGES {
                    self.changes.pop_front();
                }
                self.changes.push_back(*change);
            }
            Message::Presence(presence) if presence.role == Role::Plant as u64 => {
                self.plant.note_message(ABSENT);
                self.plant.presence = Some(*presence);
            }
            Message::Presence(presence) => {
                let now = Instant::now();
                self.controllers.retain(|_, (_, heard)| now.duration_since(*heard) < ABSENT);
                self.controllers.insert(presence.id, (*presence, now));
                if self.leader().is_none_or(|leader| leader == presence.id) {
                    self.controller.note_message(ABSENT);
                }
                self.identify_controller();
            }
            Message::Request(_) => {}
        }
    }

    /// Forgets the previous run if `run` is another one.
    fn begin(&mut self, run: u64) {
        if self.run == Some(run) {
            return;
        }
        let mut past_runs = std::mem::take(&mut self.past_runs);
        past_runs.extend(self.run);
        past_runs.drain(..past_runs.len().saturating_sub(RUNS));
        *self = Self {
            plant: self.plant,
            controller: self.controller,
            controllers: std::mem::take(&mut self.controllers),
            saw_previous_run: self.run.is_some(),
            past_runs,
            run: Some(run),
            ..Self::default()
        };
    }

    /// Notes the run's first message: if it is not of the start, this monitor may have missed changes.
    fn note_first(&mut self, header: &Header) {
        let is_first = self.state.is_none() && self.status.is_none();
        if is_first && !self.saw_previous_run && header.time_ns > 0 {
            self.joined = Some(Joined { time_ns: header.time_ns, missed_changes: header.revision });
        }
    }

    /// When this monitor joined the run; `None` if it was there from the start.
    pub fn joined(&self) -> Option<Joined> {
        self.joined
    }

    /// Selects the presence of the leader or, before there is one, of any controller.
    fn identify_controller(&mut self) {
        let leader = match self.leader() {
            Some(leader) => self.controllers.get(&leader),
            None => self.controllers.values().next(),
        };
        self.controller.presence = leader.map(|(presence, _)| *presence);
    }

    /// Whether a message belongs to a previous run: its last samples may come after the first ones
    /// of the next run.
    pub fn is_from_past_run(&self, message: &Message) -> bool {
        run_and_time(message).is_some_and(|(run, _)| self.past_runs.contains(&run))
    }

    /// Whether a change came before: a plant that gets a request twice answers it twice.
    pub fn is_known(&self, change: &ChangeSample) -> bool {
        self.changes.iter().any(|known| known.request == change.request)
    }

    fn handle_state(&mut self, state: &StateSample) {
        if let Some(before) = &self.state {
            let steps = state.header.sequence.saturating_sub(before.header.sequence);
            self.missed = self.missed.saturating_add(steps.saturating_sub(1));
            if steps > 0 && reports_new_torque(before, state) {
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

    /// The header of the newest state or, before the first state, of the newest status.
    pub fn header(&self) -> Option<Header> {
        let state = self.state.map(|state| state.header);
        state.or(self.status.map(|status| status.header))
    }

    /// The law of the newest answer or, before the first answer, of the scenario; `None` for a law
    /// that this program does not have.
    pub fn law(&self) -> Option<&'static Description> {
        match &self.error {
            Some(error) => error.description(),
            None => Some(self.scenario.as_ref()?.scenario.law.law.description()),
        }
    }

    /// The phase of the run; `None` before the first status.
    pub fn phase(&self) -> Option<Phase> {
        let phases = [Phase::Waiting, Phase::Running, Phase::Finished, Phase::Paused];
        phases.get(self.status.as_ref()?.phase as usize).copied()
    }

    /// The plant.
    pub fn plant(&self) -> &RoleStatus {
        &self.plant
    }

    /// The controller.
    pub fn controller(&self) -> &RoleStatus {
        &self.controller
    }

    /// The id of the leading controller.
    pub fn leader(&self) -> Option<u64> {
        self.state.map(|state| state.leader).filter(|leader| *leader != 0)
    }

    /// How many other controllers stand by for the leader.
    pub fn standing_by(&self) -> usize {
        let others = self
            .controllers
            .iter()
            .filter(|(id, (_, heard))| Some(**id) != self.leader() && heard.elapsed() < ABSENT);
        if self.leader().is_some() { others.count() } else { 0 }
    }

    /// The most important alarm, if there is any.
    pub fn alarm(&self) -> Option<Alarm> {
        let Some(silence) = self.plant.silence() else { return Some(Alarm::NoPlant) };
        if self.phase() == Some(Phase::Finished) {
            return None;
        }
        if silence > self.silence_limit() {
            return Some(Alarm::PlantSilent(silence));
        }
        if self.phase() == Some(Phase::Waiting) {
            return Some(Alarm::NoController);
        }
        let is_paused = self.phase() == Some(Phase::Paused);
        let limit = if is_paused { ABSENT } else { self.silence_limit() };
        let silence = self.controller.silence()?;
        (silence > limit).then_some(Alarm::ControllerSilent(silence))
    }

    fn silence_limit(&self) -> Duration {
        let period = self.scenario.as_ref().map(|offered| offered.scenario.timing.sample_period);
        SILENT.max(3 * period.unwrap_or_default())
    }
}

/// The law's signal that displays show where there is space for one: the first with a range.
pub(crate) fn primary_signal(law: &Description) -> Option<&'static Signal> {
    law.signals.iter().find(|signal| signal.range.is_some())
}

/// The run that a message belongs to, and its time within the run, ns.
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

/// Whether the plant received a torque between two states. A state holds the times of the newest
/// torque, and no two torques take the same time to the nanosecond.
pub fn reports_new_torque(before: &StateSample, state: &StateSample) -> bool {
    let times = |state: &StateSample| (state.round_trip_ns, state.residence_ns);
    times(state) != times(before)
}

/// Time between sending two successive states, minus the sample period, ns.
pub fn period_deviation_ns(before: &StateSample, state: &StateSample) -> Option<i64> {
    let is_next = state.header.run == before.header.run
        && Some(state.header.sequence) == before.header.sequence.checked_add(1);
    let since = |ns: u64, before: u64| ns.wrapping_sub(before) as i64;
    let period = since(state.header.time_ns, before.header.time_ns);
    // Sequence 0 is repeated until a controller answers; its time stamp is of the last repetition.
    (is_next && before.header.sequence > 0)
        .then(|| since(state.sent_ns, before.sent_ns).wrapping_sub(period))
}

#[cfg(test)]
mod tests {
    use mtj_protocol::sample::{VERSION, text};

    use super::*;

    fn header(run: u64, time_s: u64, revision: u32) -> Header {
        let time_ns = time_s * 1_000_000_000;
        let (version, joints, axes) = (VERSION, 2, 2);
        Header { version, joints, axes, revision, run, sequence: 100 * time_s, time_ns }
    }

    fn state(run: u64, time_s: u64, revision: u32) -> Message {
        let header = header(run, time_s, revision);
        Message::State(StateSample { header, ..Default::default() })
    }

    #[test]
    fn a_monitor_that_joins_late_knows_that_it_missed_changes() {
        let mut late = Overview::default();
        late.handle(&state(1, 275, 3));
        late.handle(&state(1, 276, 4));
        let joined = Joined { time_ns: 275_000_000_000, missed_changes: 3 };
        assert_eq!(late.joined(), Some(joined));
        assert_eq!(joined.words(), "monitor joined after 3 changes");
        late.handle(&state(2, 1, 4));
        assert_eq!(late.joined(), None, "it was there when the next run started");

        let mut early = Overview::default();
        early.handle(&state(1, 0, 0));
        early.handle(&state(1, 1, 0));
        assert_eq!(early.joined(), None);
    }

    #[test]
    fn a_role_is_as_old_as_its_presence_says_and_not_as_what_was_heard_of_it() {
        let mut overview = Overview::default();
        overview.handle(&state(1, 275, 0));
        assert!(overview.plant().age().unwrap() < Duration::from_secs(1), "all that is known yet");
        let since = SystemTime::now() - Duration::from_secs(280);
        let since_ns = since.duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        let presence = |since_ns| {
            let (header, host) = (header(1, 275, 0), text("robot"));
            let sample = PresenceSample { header, since_ns, host, ..Default::default() };
            Message::Presence(PresenceSample { role: Role::Plant as u64, ..sample })
        };
        overview.handle(&presence(since_ns));
        assert_eq!(overview.plant().age().unwrap().as_secs(), 280);
        overview.handle(&presence(u64::MAX));
        let age = overview.plant().age().unwrap();
        assert!(age < Duration::from_secs(1), "a clock that is ahead tells nothing: {age:?}");
    }
}
