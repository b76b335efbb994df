//! What all dashboards look at: filled by the monitor's loop, read by the server.
//!
//! Twenty times a second the server lets the board *publish* what has settled since the last time.
//! Whoever looks at the board has a [`Cursor`] that says how much of it he knows, and gets the
//! [`News`] since then: the step just published, ten minutes of history, or what he missed.

use std::{collections::VecDeque, sync::Arc};

use mtj_protocol::{
    port::{Message, Offered},
    sample::ChangeSample,
};

use super::{
    history::{Bin, History, WIDTH_NS, merge},
    series::Readings,
};
use crate::overview::{Overview, Phase};

/// How many bins after a state its bin counts as settled: torque and error of that instant follow.
const SETTLING: u64 = 5;
/// How many publications a state may stay away until what there is settles without it.
const PATIENCE: usize = 10;
/// The most bins of one step; more are merged.
const STEP: u64 = 500;
/// How many marks are kept.
const MARKS: usize = 200;
/// How many runs are remembered for telling stragglers.
const RUNS: usize = 16;

/// The board.
#[derive(Default)]
pub struct Board {
    /// What is known of the session.
    pub overview: Overview,
    /// What reads numbers off messages.
    pub readings: Readings,
    history: History,
    marks: VecDeque<ChangeSample>,
    /// How many marks there were in this run.
    marked: u64,
    run: Option<u64>,
    past: VecDeque<u64>,
    /// The newest state's bin.
    state: u64,
    /// The newest bin of all.
    newest: u64,
    /// `state` and `newest` at the last publications.
    lately: VecDeque<(u64, u64)>,
    published: Cursor,
    late: u64,
}

/// How much of the board is known to somebody.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cursor {
    /// Everything up to this publication.
    pub publication: u64,
    run: Option<u64>,
    revision: u32,
    marks: u64,
    bin: u64,
}

/// What somebody does not know yet.
pub struct News {
    /// The scenario, if it is another one.
    pub scenario: Option<Arc<Offered>>,
    /// Bins, oldest first.
    pub bins: Vec<Bin>,
    /// How many bins' time each of them spans.
    pub span: u64,
    /// Changes, oldest first.
    pub marks: Vec<ChangeSample>,
    /// What is known after these news.
    pub cursor: Cursor,
    /// Whether that is all that was published.
    pub is_all: bool,
}

/// What was published last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// What was published before.
    pub before: Cursor,
    /// What is published now.
    pub after: Cursor,
    /// How many neighbouring bins to merge, so that the step stays small.
    pub span: u64,
}

impl Board {
    /// Takes in one message.
    pub fn hear(&mut self, message: &Message) {
        match message {
            Message::Presence(_) | Message::Request(_) => return self.overview.hear(message),
            _ if self.is_past(message) => return,
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.readings.follow(offered);
            }
            Message::State(state) => {
                self.begin(state.header.run);
                self.state = self.state.max(state.header.time_ns / WIDTH_NS);
            }
            Message::Status(status) => self.begin(status.header.run),
            Message::Change(change) => self.mark(change),
            Message::Torque(_) | Message::Error(_) => {}
        }
        self.overview.hear(message);
        self.plot(message);
    }

    /// Whether a message belongs to a run that is over: its last samples may come after the first
    /// ones of the next run.
    fn is_past(&self, message: &Message) -> bool {
        run_and_time(message).is_some_and(|(run, _)| self.past.contains(&run))
    }

    fn begin(&mut self, run: u64) {
        if self.run == Some(run) {
            return;
        }
        if let Some(past) = self.run.replace(run) {
            self.past.push_back(past);
            self.past.drain(..self.past.len().saturating_sub(RUNS));
        }
        self.readings = Readings::default();
        self.history = History::default();
        self.marks.clear();
        self.marked = 0;
        (self.state, self.newest) = (0, 0);
        self.lately.clear();
    }

    /// A plant that is asked twice answers twice.
    fn mark(&mut self, change: &ChangeSample) {
        if self.marks.iter().any(|mark| mark.request == change.request) {
            return;
        }
        if self.marks.len() == MARKS {
            self.marks.pop_front();
        }
        self.marks.push_back(*change);
        self.marked += 1;
    }

    fn plot(&mut self, message: &Message) {
        let is_sample = !matches!(message, Message::Scenario(_) | Message::Change(_));
        let Some((run, time_ns)) = run_and_time(message).filter(|_| is_sample) else { return };
        if self.run != Some(run) {
            return;
        }
        let place = time_ns / WIDTH_NS;
        self.newest = self.newest.max(place);
        if self.published.run == self.run && place < self.published.bin {
            self.late += 1;
        }
        let Self { readings, history, .. } = self;
        readings.read(message, &mut |series, value| history.add(time_ns, series, value));
    }

    /// Messages that came after their bin was published: only who looks back sees them.
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Publishes what has settled since the last time.
    pub fn publish(&mut self) -> Step {
        let before = self.published;
        let mut span = 1;
        self.published.publication += 1;
        let settled = self.settled();
        if let (Some(run), Some(offered)) = (self.run, &self.overview.scenario)
            && offered.run == run
        {
            if self.published.run != Some(run) {
                self.published = Cursor { marks: 0, bin: 0, ..self.published };
            }
            self.published.run = Some(run);
            self.published.revision = offered.revision;
            self.published.marks = self.marked;
            let from = self.published.bin;
            let mut to = settled.max(from);
            let mut fresh = self.history.between(from, to);
            let count = fresh.len() as u64;
            if count > STEP
                && let Some(first) = fresh.next()
            {
                // Only whole groups, so that no two of them overlap; the rest waits.
                span = (to - first.place).div_ceil(STEP);
                to = first.place + (to - first.place) / span * span;
            }
            self.published.bin = to;
        }
        Step { before, after: self.published, span }
    }

    /// The first bin that samples may still be on their way to.
    fn settled(&mut self) -> u64 {
        self.lately.push_back((self.state, self.newest));
        let by_states = self.state.saturating_sub(SETTLING);
        if self.lately.len() <= PATIENCE {
            return by_states;
        }
        let Some((state, newest)) = self.lately.pop_front() else { return by_states };
        let no_more = self.overview.phase() == Some(Phase::Finished) && newest == self.newest;
        // A loop that pauses may go on in the bin it paused in.
        let by_patience = if no_more { newest + 1 } else { newest };
        if state == self.state { by_states.max(by_patience) } else { by_states }
    }

    /// What was published since a cursor stood there: at most so many bins, the oldest.
    pub fn news(&self, since: &Cursor, most: usize) -> News {
        self.news_until(since, &self.published, most, 1)
    }

    /// What a step has published, as long as the next one has not been made.
    pub fn news_of(&self, step: &Step) -> News {
        self.news_until(&step.before, &step.after, usize::MAX, step.span)
    }

    fn news_until(&self, since: &Cursor, until: &Cursor, most: usize, span: u64) -> News {
        let mut news = News {
            scenario: None,
            bins: Vec::new(),
            span,
            marks: Vec::new(),
            cursor: Cursor { publication: until.publication, ..*since },
            is_all: true,
        };
        // Of a run that has begun nothing is published before its scenario is known.
        if until.run.is_none() || until.run != self.run {
            return news;
        }
        let known = if since.run == until.run {
            *since
        } else {
            Cursor { publication: since.publication, ..Cursor::default() }
        };
        if (known.run, known.revision) != (until.run, until.revision) {
            news.scenario = self.overview.scenario.clone();
        }
        let fresh = (until.marks - known.marks.min(until.marks)) as usize;
        let published = self.marks.len() - (self.marked - until.marks) as usize;
        news.marks.extend(self.marks.range(published.saturating_sub(fresh)..published));
        let bins = self.history.between(known.bin, until.bin);
        news.is_all = bins.len() <= most;
        let first = bins.clone().next().map_or(known.bin, |bin| bin.place);
        news.bins = merge(bins.take(most).copied(), first, span);
        news.cursor = *until;
        if !news.is_all {
            news.cursor.publication = since.publication;
            news.cursor.bin = news.bins.last().map_or(known.bin, |bin| bin.place + 1);
        }
        news
    }
}

/// Which run a message is about, and when in it.
fn run_and_time(message: &Message) -> Option<(u64, u64)> {
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
