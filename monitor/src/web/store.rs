//! What dashboards show: filled by the monitor's loop, read by the server.
//!
//! Twenty times a second the server lets the store *publish* the bins that are complete. The
//! [`Cursor`] of a dashboard says how much of the store it has. The dashboard gets the [`Update`]
//! since then: the latest publication, ten minutes of history, or what it missed.

use std::{collections::VecDeque, sync::Arc};

use mtj_protocol::{
    port::{Message, Offered},
    sample::{ChangeSample, Phase},
};

use super::{
    history::{Bin, History, WIDTH_NS, merge},
    series::{SeriesIndex, SeriesReader},
};
use crate::overview::{Overview, run_and_time};

/// How many bins after a state its bin counts as complete: torque and error of that instant follow.
const COMPLETION: u64 = 5;
/// After so many publications without a new state all bins count as complete.
const PAUSE: usize = 10;
/// The most bins of one publication; more are merged.
const MOST_BINS: u64 = 500;
/// How many changes are kept.
const CHANGES: usize = 200;
/// How many samples of a run are kept until its scenario comes.
const PENDING: usize = 16_384;

/// What dashboards show of a session.
#[derive(Default)]
pub(super) struct Store {
    /// What is known of the session.
    pub overview: Overview,
    /// Extracts the plotted numbers from messages.
    pub reader: SeriesReader,
    history: History,
    changes: VecDeque<ChangeSample>,
    /// How many changes there were in this run, also those that are no longer kept.
    change_count: u64,
    run: Option<u64>,
    /// Messages of the run that came before its scenario.
    pending: Vec<Message>,
    /// The bin of the newest state.
    state: u64,
    /// The newest bin of all.
    newest: u64,
    /// `state` and `newest` at the last publications.
    progress: VecDeque<(u64, u64)>,
    published: Cursor,
    late: u64,
}

/// How much of the store a dashboard has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cursor {
    /// Everything up to the publication of this number.
    pub number: u64,
    run: Option<u64>,
    /// The revision of its scenario; `None` if it may have missed one.
    revision: Option<u32>,
    changes: u64,
    bin: u64,
}

impl Cursor {
    /// The cursor of a page that reconnects with `run=<run>&since=<s>`: the start of its newest
    /// bin.
    pub(super) fn of_query(query: &str) -> Option<Self> {
        let value =
            |key: &str| query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
        let since: f64 = value("since")?.parse().ok()?;
        let bin = (since * 1e9 / WIDTH_NS as f64).round();
        // The page may have missed a change, so it gets the scenario and all changes.
        (bin >= 0.0).then_some(Self {
            run: Some(value("run")?.parse().ok()?),
            bin: (bin as u64).saturating_add(1),
            ..Self::default()
        })
    }
}

/// What a dashboard does not have yet.
pub(super) struct Update {
    /// The scenario, if it is new.
    pub scenario: Option<Arc<Offered>>,
    /// The series of the bins.
    pub index: Arc<SeriesIndex>,
    /// Bins, oldest first.
    pub bins: Vec<Bin>,
    /// How many bins of the history are merged into each of `bins`.
    pub span: u64,
    /// Changes, oldest first.
    pub changes: Vec<ChangeSample>,
    /// The dashboard's cursor after this update.
    pub cursor: Cursor,
    /// Whether the dashboard then has everything that was published.
    pub is_complete: bool,
}

/// The latest publication.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Publication {
    /// Everything that was published before.
    pub before: Cursor,
    /// Everything that is published now.
    pub after: Cursor,
    /// How many neighbouring bins to merge, so that the publication stays small.
    pub span: u64,
}

impl Store {
    /// Takes one message.
    pub(super) fn handle(&mut self, message: &Message) {
        match message {
            Message::Presence(_) | Message::Request(_) => return self.overview.handle(message),
            _ if self.overview.is_from_past_run(message) => return,
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.reader.set_scenario(&offered.scenario);
                let series = self.reader.index().names().len();
                if self.history.series() != series {
                    self.history = History::new(series);
                }
                for pending in std::mem::take(&mut self.pending) {
                    self.plot(&pending);
                }
            }
            Message::State(state) => {
                self.begin(state.header.run);
                self.state = self.state.max(state.header.time_ns / WIDTH_NS);
            }
            Message::Status(status) => self.begin(status.header.run),
            Message::Change(change) => self.add_change(change),
            Message::Torque(_) | Message::Error(_) => {}
        }
        self.overview.handle(message);
        self.plot(message);
    }

    fn begin(&mut self, run: u64) {
        if self.run == Some(run) {
            return;
        }
        self.run = Some(run);
        self.reader = SeriesReader::default();
        self.history = History::default();
        self.pending.clear();
        self.changes.clear();
        self.change_count = 0;
        (self.state, self.newest) = (0, 0);
        self.progress.clear();
    }

    /// Adds a change unless it came before: a plant that gets a request twice answers it twice.
    fn add_change(&mut self, change: &ChangeSample) {
        if self.overview.is_known(change) {
            return;
        }
        if self.changes.len() == CHANGES {
            self.changes.pop_front();
        }
        self.changes.push_back(*change);
        self.change_count += 1;
    }

    fn plot(&mut self, message: &Message) {
        let is_sample = !matches!(message, Message::Scenario(_) | Message::Change(_));
        let Some((run, time_ns)) = run_and_time(message).filter(|_| is_sample) else { return };
        if self.run != Some(run) {
            return;
        }
        if self.reader.scene().is_none() && self.pending.len() < PENDING {
            return self.pending.push(message.clone());
        }
        let index = time_ns / WIDTH_NS;
        self.newest = self.newest.max(index);
        if self.published.run == self.run && index < self.published.bin {
            self.late += 1;
        }
        let Self { reader, history, .. } = self;
        reader.read(message, &mut |series, value| history.add(time_ns, series, value));
    }

    /// How many messages came after their bin was published: dashboards that have the bin miss
    /// them.
    pub(super) fn late(&self) -> u64 {
        self.late
    }

    /// Publishes the bins that are complete.
    pub(super) fn publish(&mut self) -> Publication {
        let before = self.published;
        let mut span = 1;
        self.published.number += 1;
        let complete = self.first_incomplete();
        if let (Some(run), Some(offered)) = (self.run, &self.overview.scenario)
            && offered.run == run
        {
            if self.published.run != Some(run) {
                self.published = Cursor { changes: 0, bin: 0, ..self.published };
            }
            self.published.run = Some(run);
            self.published.revision = Some(offered.revision);
            self.published.changes = self.change_count;
            let from = self.published.bin;
            let mut to = complete.max(from);
            let mut fresh = self.history.between(from, to);
            let count = fresh.len() as u64;
            if count > MOST_BINS
                && let Some(first) = fresh.next()
            {
                // Only whole groups, so that no two of them overlap; the rest waits.
                span = (to - first.number).div_ceil(MOST_BINS);
                to = first.number + (to - first.number) / span * span;
            }
            self.published.bin = to;
        }
        Publication { before, after: self.published, span }
    }

    /// The first bin that may still get samples.
    fn first_incomplete(&mut self) -> u64 {
        self.progress.push_back((self.state, self.newest));
        let by_states = self.state.saturating_sub(COMPLETION);
        if self.progress.len() <= PAUSE {
            return by_states;
        }
        let Some((state, newest)) = self.progress.pop_front() else { return by_states };
        let is_over = self.overview.phase() == Some(Phase::Finished) && newest == self.newest;
        // A loop that was paused may continue in the same bin.
        let by_pause = if is_over { newest + 1 } else { newest };
        if state == self.state { by_states.max(by_pause) } else { by_states }
    }

    /// What was published after a cursor: of the bins the `most` oldest.
    pub(super) fn update_since(&self, since: &Cursor, most: usize) -> Update {
        self.update_between(since, &self.published, most, 1)
    }

    /// What the latest publication has published.
    pub(super) fn update_of(&self, publication: &Publication) -> Update {
        self.update_between(&publication.before, &publication.after, usize::MAX, publication.span)
    }

    fn update_between(&self, since: &Cursor, until: &Cursor, most: usize, span: u64) -> Update {
        let mut update = Update {
            scenario: None,
            index: Arc::clone(self.reader.index()),
            bins: Vec::new(),
            span,
            changes: Vec::new(),
            cursor: Cursor { number: until.number, ..*since },
            is_complete: true,
        };
        // Nothing of a new run is published before its scenario comes.
        if until.run.is_none() || until.run != self.run {
            return update;
        }
        let known = if since.run == until.run {
            *since
        } else {
            Cursor { number: since.number, ..Cursor::default() }
        };
        if (known.run, known.revision) != (until.run, until.revision) {
            update.scenario = self.overview.scenario.clone();
        }
        let fresh = (until.changes - known.changes.min(until.changes)) as usize;
        let published = self.changes.len() - (self.change_count - until.changes) as usize;
        update.changes.extend(self.changes.range(published.saturating_sub(fresh)..published));
        let bins = self.history.between(known.bin, until.bin);
        update.is_complete = bins.len() <= most;
        let first = bins.clone().next().map_or(known.bin, |bin| bin.number);
        update.bins = merge(bins.take(most).cloned(), first, span);
        update.cursor = *until;
        if !update.is_complete {
            update.cursor.number = since.number;
            update.cursor.bin = update.bins.last().map_or(known.bin, |bin| bin.number + 1);
        }
        update
    }
}

#[cfg(test)]
mod tests;
