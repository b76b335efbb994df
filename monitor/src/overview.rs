//! What is known of a session: the same for all displays.

mod alarm;
mod role;

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
        ChangeSample, ErrorSample, Header, Phase, PresenceSample, StateSample, StatusSample,
        TorqueSample,
    },
};

pub use self::{
    alarm::{Alarm, Joined},
    role::RoleStatus,
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
    /// The newest presence of each plant by its id, and when it came.
    plants: BTreeMap<u64, (PresenceSample, Instant)>,
    controller: RoleStatus,
    /// The newest presence of each controller by its id, and when it came.
    controllers: BTreeMap<u64, (PresenceSample, Instant)>,
    run: Option<u64>,
    past_runs: VecDeque<u64>,
    /// Whether this monitor was there before the run.
    saw_previous_run: bool,
    joined: Option<Joined>,
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
                note(&mut self.plants, presence);
                self.plant.note_message(ABSENT);
                self.plant.presence = Some(*presence);
            }
            Message::Presence(presence) => {
                note(&mut self.controllers, presence);
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
            plants: std::mem::take(&mut self.plants),
            controller: self.controller,
            controllers: std::mem::take(&mut self.controllers),
            saw_previous_run: self.run.is_some(),
            past_runs,
            run: Some(run),
            ..Self::default()
        };
    }

    /// Notes the run's first message: if it is not of the start, this monitor may have missed
    /// changes.
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
        self.status.as_ref()?.phase()
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
        self.state.and_then(|state| state.leader())
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
        if let Some(alarm) = self.two_plants() {
            return Some(alarm);
        }
        if silence > self.silence_limit() {
            return Some(Alarm::PlantSilent(silence));
        }
        if self.phase() == Some(Phase::Diverged) {
            return Some(Alarm::Diverged(self.time()));
        }
        if self.phase() == Some(Phase::Stopped) {
            return Some(Alarm::Stopped);
        }
        if self.phase() == Some(Phase::Waiting) {
            return Some(Alarm::NoController);
        }
        let is_paused = self.phase() == Some(Phase::Paused);
        let limit = if is_paused { ABSENT } else { self.silence_limit() };
        let silence = self.controller.silence()?;
        let is_silent = silence > limit;
        let silent = is_silent.then_some(Alarm::ControllerSilent(silence));
        silent.or_else(|| self.safe_state())
    }

    fn two_plants(&self) -> Option<Alarm> {
        let mut present = self
            .plants
            .values()
            .filter(|(_, heard)| heard.elapsed() < ABSENT)
            .map(|(plant, _)| plant);
        let (one, other) = (present.next()?, present.next()?);
        Some(Alarm::TwoPlants(one.process, other.process))
    }

    fn safe_state(&self) -> Option<Alarm> {
        self.state.filter(|state| state.timed_out != 0)?;
        let reaction = self.scenario.as_ref()?.scenario.safety.on_timeout;
        Some(Alarm::SafeState { reaction, too_old: self.status?.too_old })
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

/// Notes a presence, and forgets those that were not repeated.
fn note(present: &mut BTreeMap<u64, (PresenceSample, Instant)>, presence: &PresenceSample) {
    let now = Instant::now();
    present.retain(|_, (_, heard)| now.duration_since(*heard) < ABSENT);
    present.insert(presence.id, (*presence, now));
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
mod tests;
