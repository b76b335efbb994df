//! What a monitor knows of a session, gathered from what it hears.

use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use mtj_model::scenario::LawKind;
use mtj_protocol::{
    port::Message,
    sample::{ErrorSample, StateSample, StatusSample},
};

/// The last second of a session, and its book-keeping.
pub struct View {
    last_heard: Option<Instant>,
    run: u64,
    time_ns: u64,
    law: Option<LawKind>,
    squared_error: f64,
    factor: f64,
    errors: u64,
    round_trips: Histogram<u64>,
    status: Option<StatusSample>,
    next_sequence: Option<u64>,
    missed: u64,
}

/// The longest round trip told apart, ns.
const LONGEST_NS: u64 = 60_000_000_000;

impl Default for View {
    #[expect(clippy::expect_used, reason = "constant bounds")]
    fn default() -> Self {
        Self {
            last_heard: None,
            run: 0,
            time_ns: 0,
            law: None,
            squared_error: 0.0,
            factor: 0.0,
            errors: 0,
            round_trips: Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("valid bounds"),
            status: None,
            next_sequence: None,
            missed: 0,
        }
    }
}

impl View {
    /// Takes in one message.
    pub fn hear(&mut self, message: Message) {
        match message {
            Message::State(state) => self.hear_state(&state),
            Message::Error(error) => self.hear_error(&error),
            Message::Status(status) => {
                self.time_ns = self.time_ns.max(status.header.time_ns);
                self.last_heard = Some(Instant::now());
                self.status = Some(status);
            }
            Message::Torque(_) => {}
        }
    }

    fn hear_state(&mut self, state: &StateSample) {
        let header = state.header;
        if header.run != self.run {
            *self = Self { run: header.run, ..Self::default() };
        }
        self.last_heard = Some(Instant::now());
        self.time_ns = header.time_ns;
        if state.round_trip_ns > 0 {
            self.round_trips.saturating_record(state.round_trip_ns.min(LONGEST_NS));
        }
        // The first state is repeated until a controller answers.
        if let Some(next) = self.next_sequence {
            self.missed += header.sequence.saturating_sub(next);
        }
        self.next_sequence = Some(header.sequence + 1);
    }

    fn hear_error(&mut self, error: &ErrorSample) {
        let axes = error.header.axes as usize;
        self.law = [LawKind::Tj, LawKind::Mtj, LawKind::Mb].get(error.law as usize).copied();
        self.squared_error += error.error[..axes].iter().map(|e| e * e).sum::<f64>();
        self.factor += error.factor[..axes].iter().sum::<f64>() / axes as f64;
        self.errors += 1;
    }

    /// How long nothing has been heard of the plant; `None` if nothing ever was.
    pub fn silence(&self) -> Option<Duration> {
        self.last_heard.map(|heard| heard.elapsed())
    }

    /// The last second in one line; a new second begins.
    pub fn line(&mut self) -> String {
        let over = |sum: f64| sum / self.errors.max(1) as f64;
        let time = self.time_ns as f64 * 1e-9;
        let mut line = format!("t {time:7.1} s  {:<3}", self.law.map_or("-", LawKind::name));
        if self.errors > 0 {
            let factor = if self.law == Some(LawKind::Mtj) {
                format!("{:.3}", over(self.factor))
            } else {
                "-    ".to_owned()
            };
            line += &format!("  |e| {:.2e} m  k {factor}", over(self.squared_error).sqrt());
        } else {
            line += "  no controller      ";
        }
        if !self.round_trips.is_empty() {
            let at = |quantile| self.round_trips.value_at_quantile(quantile) as f64 / 1e3;
            line += &format!("  round trip p50 {:7.1} p99 {:7.1} µs", at(0.5), at(0.99));
        }
        if let Some(status) = &self.status {
            let StatusSample { deadline_misses, late, lost, rejected, .. } = status;
            line += &format!(
                "  misses {deadline_misses}  late {late}  lost {lost}  rejected {rejected}"
            );
        }
        if self.missed > 0 {
            line += &format!("  (this monitor missed {} samples)", self.missed);
        }
        self.squared_error = 0.0;
        self.factor = 0.0;
        self.errors = 0;
        self.round_trips.reset();
        line
    }
}
