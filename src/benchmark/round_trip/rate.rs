//! The highest sample rate that a loop holds in real time.

use std::time::Duration;

use serde::Serialize;

use super::{Effort, Proceed, Way, own};
use crate::failure::Failure;

/// The result of one rate.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Held {
    /// Transport.
    pub bus: &'static str,
    /// How both ends waited.
    pub wait: &'static str,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Whether no deadline was missed and no command lost or late.
    pub is_held: bool,
    /// Sampling instants reached only after the next was due.
    pub deadline_misses: u64,
    /// Commands that never came.
    pub lost: u64,
    /// Commands that came after the next sampling instant.
    pub late: u64,
}

/// Tries first this rate, Hz.
const FIRST: f64 = 500.0;
/// Faster than any arm is sampled, Hz.
const LAST: f64 = 512_000.0;
/// Ends when the rate is known this well.
const PRECISION: f64 = 1.1;

/// Doubles the rate until it is not held for `duration`, then halves the interval between. `note`
/// takes each attempt; returns the highest rate that was held, Hz, if any was.
pub(crate) fn highest_rate(
    way: Way,
    duration: Duration,
    effort: &Effort,
    proceed: Proceed<'_>,
    note: &mut dyn FnMut(&Held),
) -> Result<Option<f64>, Failure> {
    let (mut held, mut failed) = (None, None);
    let mut rate = FIRST;
    while rate <= LAST {
        let Some(attempt) = attempt(way, rate, duration, effort, proceed)? else { break };
        note(&attempt);
        if attempt.is_held {
            held = Some(rate);
        } else {
            failed = Some(rate);
        }
        rate = match (held, failed) {
            (Some(held), None) => 2.0 * held,
            (Some(held), Some(failed)) if failed / held > PRECISION => (held * failed).sqrt(),
            (None, Some(failed)) if failed > 10.0 => failed / 4.0,
            _ => break,
        };
    }
    Ok(held)
}

fn attempt(
    way: Way,
    rate: f64,
    duration: Duration,
    effort: &Effort,
    proceed: Proceed<'_>,
) -> Result<Option<Held>, Failure> {
    let period = (1e9 / rate).round();
    let set = vec![
        format!("duration={} ns", duration.as_nanos()),
        "timing.clock=realtime".to_owned(),
        format!("timing.sample_period={period} ns"),
        format!("timing.integration_step={period} ns"),
    ];
    let Some(outcome) = own::run(way, effort, set, proceed)? else { return Ok(None) };
    let report = outcome.report;
    let (lost, late) = (report.commands.lost, report.commands.late);
    // In real time they are always counted.
    let deadline_misses = report.deadline_misses.unwrap_or(u64::MAX);
    Ok(Some(Held {
        bus: way.bus.name(),
        wait: way.wait.name(),
        rate_hz: 1e9 / period,
        is_held: deadline_misses == 0 && lost == 0 && late == 0,
        deadline_misses,
        lost,
        late,
    }))
}
