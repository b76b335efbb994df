//! The plain view: one line a second.

use std::{
    io::Write,
    time::{Duration, Instant},
};

use mtj_model::scenario::LawKind;
use mtj_protocol::{bus::BusError, port::Message, sample::ErrorSample};

use crate::{
    monitor::Audience,
    overview::{Overview, Phase},
};

/// Prints what happens in a session.
pub struct Lines<W> {
    out: W,
    overview: Overview,
    second: Second,
    next: Instant,
}

/// Sums over the errors of the current second.
#[derive(Default)]
pub(crate) struct Second {
    squared_error: f64,
    factor: f64,
    errors: u64,
}

impl Second {
    /// Counts one in.
    pub fn add(&mut self, error: &ErrorSample) {
        let axes = error.header.axes as usize;
        self.squared_error += error.error[..axes].iter().map(|e| e * e).sum::<f64>();
        self.factor += error.factor[..axes].iter().sum::<f64>() / axes as f64;
        self.errors += 1;
    }

    /// Root mean square of the tracking error, m; `None` if there was no error sample.
    pub fn rms_error(&self) -> Option<f64> {
        self.over(self.squared_error).map(f64::sqrt)
    }

    /// Mean of k.
    pub fn mean_factor(&self) -> Option<f64> {
        self.over(self.factor)
    }

    fn over(&self, sum: f64) -> Option<f64> {
        (self.errors > 0).then(|| sum / self.errors as f64)
    }
}

impl<W: Write> Lines<W> {
    /// Prints to `out`.
    pub fn new(out: W) -> Self {
        Self {
            out,
            overview: Overview::default(),
            second: Second::default(),
            next: Instant::now() + Duration::from_secs(1),
        }
    }

    fn line(&self) -> String {
        let Overview { status, round_trips, missed, .. } = &self.overview;
        let law = self.overview.law();
        let mut line =
            format!("t {:7.1} s  {:<3}", self.overview.time(), law.map_or("-", LawKind::name));
        if let Some(error) = self.second.rms_error() {
            let factor = match (law, self.second.mean_factor()) {
                (Some(LawKind::Mtj), Some(factor)) => format!("{factor:.3}"),
                _ => "-    ".to_owned(),
            };
            line += &format!("  |e| {error:.2e} m  k {factor}");
        } else if self.overview.phase() == Some(Phase::Paused) {
            line += "  paused             ";
        } else {
            line += "  no controller      ";
        }
        if let Some(spread) = round_trips.spread() {
            line += &format!("  round trip p50 {:7.1} p99 {:7.1} µs", spread.p50, spread.p99);
        }
        if let Some(status) = status {
            line += &format!(
                "  misses {}  late {}  lost {}  rejected {}",
                status.deadline_misses, status.late, status.lost, status.rejected
            );
            for (name, count) in [("timeouts", status.timeouts), ("takeovers", status.takeovers)] {
                if count > 0 {
                    line += &format!("  {name} {count}");
                }
            }
        }
        if *missed > 0 {
            line += &format!("  (this monitor missed {missed} samples)");
        }
        line
    }

    /// Whether somebody still reads.
    fn print(&mut self, line: &str) -> bool {
        writeln!(self.out, "{line}").and_then(|()| self.out.flush()).is_ok()
    }
}

impl<W: Write> Audience for Lines<W> {
    fn hear(&mut self, message: &Message) {
        let is_news = !matches!(message, Message::Change(change) if self.overview.knows(change));
        self.overview.hear(message);
        match message {
            Message::Error(error) => self.second.add(error),
            Message::Change(change) if is_news => {
                let time = change.header.time_ns as f64 * 1e-9;
                let line = match change.outcome() {
                    Ok(()) => format!("t {time:7.1} s  changed: {}", change.words()),
                    Err(reason) => format!("t {time:7.1} s  refused: {reason}"),
                };
                self.print(&line);
            }
            _ => {}
        }
    }

    fn refresh(&mut self) -> Result<bool, BusError> {
        if Instant::now() < self.next {
            return Ok(true);
        }
        self.next += Duration::from_secs(1);
        let line = match self.overview.alarm() {
            Some(alarm) => alarm.sentence(),
            None => self.line(),
        };
        self.second = Second::default();
        Ok(self.print(&line))
    }
}
