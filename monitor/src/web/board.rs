//! What all dashboards look at: filled by the monitor's loop, read by the server.
//!
//! Twenty times a second the server lets the board *publish* what has settled since the last time.
//! A client has a [`Cursor`] that says how much of the board it knows, and gets the [`News`] since then:
//! the step just published, ten minutes of history, or what it missed.

use std::{collections::VecDeque, sync::Arc};

use mtj_protocol::{
    port::{Message, Offered},
    sample::ChangeSample,
};

use super::{
    history::{Bin, History, WIDTH_NS, merge},
    series::{Readings, Table},
};
use crate::overview::{Overview, Phase, run_and_time};

/// How many bins after a state its bin counts as settled: torque and error of that instant follow.
const SETTLING: u64 = 5;
/// How many publications a state may stay away until what there is settles without it.
const PATIENCE: usize = 10;
/// The most bins of one step; more are merged.
const STEP: u64 = 500;
/// How many marks are kept.
const MARKS: usize = 200;
/// How many samples are kept until the scenario is known that they are about.
const EARLY: usize = 16_384;

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
    /// What was heard of the run before its scenario was: the scenario is fetched, samples come.
    early: Vec<Message>,
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

impl Cursor {
    /// Of a page that was here before and says what it has: `run=<run>&since=<s>`, the beginning of
    /// its newest bin.
    pub fn of_query(query: &str) -> Option<Self> {
        let value =
            |key: &str| query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
        let since: f64 = value("since")?.parse().ok()?;
        let bin = (since * 1e9 / WIDTH_NS as f64).round();
        // It may have missed a change, so it gets the scenario and the marks.
        (bin >= 0.0).then_some(Self {
            run: Some(value("run")?.parse().ok()?),
            revision: u32::MAX,
            bin: (bin as u64).saturating_add(1),
            ..Self::default()
        })
    }
}

/// What somebody does not know yet.
pub struct News {
    /// The scenario, if it is another one.
    pub scenario: Option<Arc<Offered>>,
    /// Which series the bins are of.
    pub table: Arc<Table>,
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
            _ if self.overview.is_past(message) => return,
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.readings.follow(&offered.scenario);
                let series = self.readings.table().names().len();
                if self.history.series() != series {
                    self.history = History::new(series);
                }
                for early in std::mem::take(&mut self.early) {
                    self.plot(&early);
                }
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

    fn begin(&mut self, run: u64) {
        if self.run == Some(run) {
            return;
        }
        self.run = Some(run);
        self.readings = Readings::default();
        self.history = History::default();
        self.early.clear();
        self.marks.clear();
        self.marked = 0;
        (self.state, self.newest) = (0, 0);
        self.lately.clear();
    }

    /// A plant that is asked twice answers twice.
    fn mark(&mut self, change: &ChangeSample) {
        if self.overview.knows(change) {
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
        if self.readings.scene().is_none() && self.early.len() < EARLY {
            return self.early.push(message.clone());
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
            table: Arc::clone(self.readings.table()),
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
        news.bins = merge(bins.take(most).cloned(), first, span);
        news.cursor = *until;
        if !news.is_all {
            news.cursor.publication = since.publication;
            news.cursor.bin = news.bins.last().map_or(known.bin, |bin| bin.place + 1);
        }
        news
    }
}

#[cfg(test)]
mod tests {
    use mtj_model::scenario::Scenario;
    use mtj_protocol::sample::{Header, StateSample, StatusSample, TorqueSample, VERSION, padded};

    use super::*;

    const MS: u64 = 1_000_000;

    fn header(run: u64, time_ns: u64) -> Header {
        let sequence = time_ns / MS;
        Header { version: VERSION, joints: 2, axes: 2, revision: 0, run, sequence, time_ns }
    }

    fn scenario(run: u64, revision: u32) -> Message {
        let scenario = Scenario::load("sampled/mtj", &[]).unwrap();
        Message::Scenario(Arc::new(Offered { run, revision, scenario }))
    }

    fn state(run: u64, time_ns: u64) -> Message {
        Message::State(StateSample { header: header(run, time_ns), ..Default::default() })
    }

    fn torque(run: u64, time_ns: u64, torque: f64) -> Message {
        let header = header(run, time_ns);
        Message::Torque(TorqueSample { header, torque: padded(&[torque]), ..Default::default() })
    }

    fn status(run: u64, time_ns: u64, phase: u64) -> Message {
        Message::Status(StatusSample { header: header(run, time_ns), phase, ..Default::default() })
    }

    fn change(run: u64, request: u64) -> Message {
        let header = header(run, 5 * MS);
        Message::Change(ChangeSample { header, request, accepted: 1, ..Default::default() })
    }

    /// A board of run 1 that has heard its scenario and states of so many milliseconds.
    fn board(milliseconds: u64) -> Board {
        let mut board = Board::default();
        board.hear(&scenario(1, 0));
        for k in 0..milliseconds {
            board.hear(&state(1, k * MS));
        }
        board
    }

    fn places(news: &News) -> Vec<u64> {
        news.bins.iter().map(|bin| bin.place).collect()
    }

    #[test]
    fn steps_and_history_hold_the_same_bins_each_once() {
        let mut board = board(0);
        let (mut by_steps, mut lazy, mut by_looking) = (Vec::new(), Cursor::default(), Vec::new());
        for k in 0..3000 {
            board.hear(&state(1, k * MS));
            // Torques come while states go on, well within the time of settling.
            if let Some(k) = k.checked_sub(30) {
                board.hear(&torque(1, k * MS, k as f64));
            }
            if k % 50 == 49 {
                let step = board.publish();
                let news = board.news_of(&step);
                assert_eq!((news.cursor, news.is_all), (step.after, true));
                by_steps.extend(news.bins);
            }
            if k % 700 == 699 {
                loop {
                    let news = board.news(&lazy, 20);
                    assert!(news.bins.len() <= 20);
                    lazy = news.cursor;
                    by_looking.extend(news.bins);
                    if news.is_all {
                        break;
                    }
                }
            }
        }
        let step = board.publish();
        by_steps.extend(board.news_of(&step).bins);
        by_looking.extend(board.news(&lazy, usize::MAX).bins);
        let series = board.readings.table().place("torque.0");
        for bins in [&by_steps, &by_looking] {
            let places: Vec<u64> = bins.iter().map(|bin| bin.place).collect();
            assert_eq!(places, (0..294).collect::<Vec<_>>());
            for bin in bins.iter() {
                let torque = bin.ranges[series];
                let first = 10.0 * bin.place as f32;
                assert_eq!((torque.min, torque.max), (first, first + 9.0), "bin {}", bin.place);
            }
        }
        assert_eq!(board.late(), 0);
        board.hear(&torque(1, 7 * MS, 0.0));
        assert_eq!(board.late(), 1, "what comes too late is counted");
    }

    #[test]
    fn a_fast_run_is_merged_into_whole_groups_that_do_not_overlap() {
        let mut board = board(0);
        let (mut next, mut total) = (0, 0);
        for round in 0..20 {
            for k in 0..1777 {
                board.hear(&state(1, (round * 1777 + k) * 10 * MS));
            }
            let step = board.publish();
            let news = board.news_of(&step);
            assert!(news.bins.len() <= 500 && news.span >= 3, "{} {}", news.bins.len(), news.span);
            for place in places(&news) {
                assert_eq!(place, next);
                next = place + news.span;
            }
            total += news.bins.len();
        }
        assert!(total > 20 * 400);
        assert!(next > 20 * 1777 - 20, "{next}");
    }

    #[test]
    fn what_a_loop_did_last_is_shown_though_nothing_follows() {
        let mut board = board(1000);
        board.hear(&status(1, 999 * MS, 3));
        let last = |board: &mut Board| {
            for _ in 0..20 {
                board.publish();
            }
            *places(&board.news(&Cursor::default(), usize::MAX)).last().unwrap()
        };
        assert_eq!(last(&mut board), 98, "a pause may go on in the bin it began in");
        board.hear(&status(1, 999 * MS, 2));
        assert_eq!(last(&mut board), 99);
        assert_eq!(board.late(), 0);
    }

    #[test]
    fn another_run_begins_anew_and_stragglers_do_not_bring_the_last_one_back() {
        let mut board = board(1000);
        board.hear(&change(1, 77));
        board.publish();
        let known = board.news(&Cursor::default(), usize::MAX).cursor;
        board.hear(&state(2, 0));
        board.hear(&status(1, 999 * MS, 1));
        let step = board.publish();
        let news = board.news_of(&step);
        assert!(news.scenario.is_none() && news.bins.is_empty(), "its scenario is not known yet");
        board.hear(&scenario(2, 0));
        for k in 0..200 {
            board.hear(&state(2, k * MS));
            board.hear(&torque(1, (999 - k) * MS, 1e9));
        }
        board.publish();
        for since in [known, Cursor::default()] {
            let news = board.news(&since, usize::MAX);
            assert_eq!(news.scenario.unwrap().run, 2);
            assert_eq!(
                news.bins.iter().map(|bin| bin.place).collect::<Vec<_>>(),
                (0..14).collect::<Vec<_>>()
            );
            let series = board.readings.table().place("torque.0");
            assert!(news.bins.iter().all(|bin| bin.ranges[series].is_empty()));
            assert!(news.marks.is_empty());
        }
    }

    #[test]
    fn a_change_is_told_once_and_with_the_scenario_it_made() {
        let mut board = board(100);
        board.publish();
        let known = board.news(&Cursor::default(), usize::MAX).cursor;
        board.hear(&change(1, 77));
        board.hear(&change(1, 77));
        board.hear(&scenario(1, 1));
        let step = board.publish();
        for news in [board.news_of(&step), board.news(&known, usize::MAX)] {
            assert_eq!(news.marks.len(), 1, "a plant that is asked twice answers twice");
            assert_eq!(news.scenario.unwrap().revision, 1);
        }
        let step = board.publish();
        let news = board.news_of(&step);
        assert!(news.marks.is_empty() && news.scenario.is_none());
    }

    #[test]
    fn whoever_comes_back_gets_what_is_new() {
        let mut board = board(1000);
        board.publish();
        let back = Cursor::of_query("run=1&since=0.57").unwrap();
        let news = board.news(&back, usize::MAX);
        assert_eq!((places(&news)[0], news.scenario.unwrap().run), (58, 1));
        let elsewhere = Cursor::of_query("since=0.57&run=18446744073709551615").unwrap();
        assert_eq!(places(&board.news(&elsewhere, usize::MAX))[0], 0);
        for nonsense in ["", "run=1", "run=x&since=1", "run=1&since=-1", "run=1&since=NaN"] {
            assert_eq!(Cursor::of_query(nonsense), None, "{nonsense}");
        }
    }
}
