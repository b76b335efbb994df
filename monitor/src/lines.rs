//! One line of text a second.

use std::{
    io::Write,
    time::{Duration, Instant},
};

use mtj_model::law::Signal;
use mtj_protocol::{
    port::Message,
    sample::{ErrorSample, Phase},
};

use crate::{
    error::MonitorError,
    monitor::Sink,
    overview::{Overview, primary_signal},
};

/// Prints the state of a session once a second, and each change when it comes.
#[derive(Debug)]
pub struct Lines<W> {
    out: W,
    overview: Overview,
    second: SecondSummary,
    next: Instant,
}

/// Sums over the error samples of the current second.
#[derive(Debug, Default)]
pub(crate) struct SecondSummary {
    squared_error: f64,
    errors: u64,
    /// The law's primary signal, the sum of its means over the axes, and how many there are.
    signal: Option<(&'static Signal, f64, u64)>,
}

impl SecondSummary {
    /// Adds one error sample.
    pub(crate) fn add(&mut self, error: &ErrorSample) {
        let axes = error.header.axes as usize;
        self.squared_error += error.error[..axes].iter().map(|e| e * e).sum::<f64>();
        self.errors += 1;
        let Some(signal) = error.description().and_then(primary_signal) else { return };
        let Some(numbers) = error.signal(signal.key) else { return };
        let mean = numbers.iter().sum::<f64>() / numbers.len() as f64;
        let (sum, count) = match self.signal {
            Some((known, sum, count)) if known == signal => (sum, count),
            _ => (0.0, 0),
        };
        self.signal = Some((signal, sum + mean, count + 1));
    }

    /// Root mean square of the tracking error, m; `None` if there was no error sample.
    pub(crate) fn rms_error(&self) -> Option<f64> {
        (self.errors > 0).then(|| (self.squared_error / self.errors as f64).sqrt())
    }

    /// The symbol of the law's primary signal and its mean; `None` if the law has none.
    pub(crate) fn signal(&self) -> Option<(&'static str, f64)> {
        let (signal, sum, count) = self.signal?;
        Some((signal.symbol, sum / count as f64))
    }
}

impl<W: Write> Lines<W> {
    /// Prints to `out`.
    pub fn new(out: W) -> Self {
        Self {
            out,
            overview: Overview::default(),
            second: SecondSummary::default(),
            next: Instant::now() + Duration::from_secs(1),
        }
    }

    fn line(&self) -> String {
        let Overview { status, round_trips, missed, .. } = &self.overview;
        let law = self.overview.law();
        let law = law.map_or("-", |law| law.name);
        let mut line = format!("t {:7.1} s  {law:<3}", self.overview.time());
        if let Some(error) = self.second.rms_error() {
            let signal = self.second.signal();
            let signal =
                signal.map_or(String::new(), |(symbol, mean)| format!("{symbol} {mean:.3}"));
            line += &format!("  |e| {error:.2e} m  {signal:<7}");
        } else if self.overview.phase() == Some(Phase::Paused) {
            line += "  paused             ";
        } else {
            // A controller need not say what it makes of the states that it answers.
            line += "  |e| unknown        ";
        }
        if let Some(spread) = round_trips.spread() {
            line += &format!("  round trip p50 {:7.1} p99 {:7.1} µs", spread.p50, spread.p99);
        }
        if let Some(status) = status {
            line += &format!(
                "  misses {}  late {}  lost {}  rejected {}",
                status.deadline_misses, status.late, status.lost, status.rejected
            );
            for (name, count) in [
                ("too old", status.too_old),
                ("stalls", status.stalls),
                ("timeouts", status.timeouts),
                ("takeovers", status.takeovers),
            ] {
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

    /// Prints a line; false if the reader of the output has gone.
    fn print(&mut self, line: &str) -> bool {
        writeln!(self.out, "{line}").and_then(|()| self.out.flush()).is_ok()
    }
}

impl<W: Write> Sink for Lines<W> {
    fn handle(&mut self, message: &Message) {
        let is_new = !matches!(message, Message::Change(change) if self.overview.is_known(change));
        self.overview.handle(message);
        match message {
            Message::Error(error) => self.second.add(error),
            Message::Change(change) if is_new => {
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

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        if Instant::now() < self.next {
            return Ok(true);
        }
        self.next += Duration::from_secs(1);
        let line = match self.overview.alarm() {
            Some(alarm) => alarm.sentence(),
            None => self.line(),
        };
        self.second = SecondSummary::default();
        Ok(self.print(&line))
    }
}
