//! What a simulation of the arm does with a proposal.

use mtj_model::scenario::Scenario;
use mtj_plant::trace::Row;
use serde::Serialize;

use super::Wanted;
use crate::{experiment, failure::Failure};

/// The measures of one simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verification {
    /// Whether the arm ran away.
    pub diverged: bool,
    /// Over the second half, m.
    pub rms_error_m: Option<f64>,
    /// Over the whole run, per joint, N m.
    pub peak_torque_nm: Vec<f64>,
    /// Over the second half, per joint, N m.
    pub settled_torque_nm: Vec<f64>,
    /// Of the initial decay, s; null where the error does not decay far enough to tell.
    pub time_constant_s: Option<f64>,
    /// rms error of the last quarter over that of the one before.
    pub growth: f64,
}

/// An error that grows by more than this from the third quarter to the last is not stable.
const GROWTH: f64 = 1.5;

/// Runs a scenario in lockstep.
pub fn run(scenario: &Scenario, proceed: &dyn Fn() -> bool) -> Result<Verification, Failure> {
    let run = experiment::run_direct(scenario, true, proceed)?;
    let rows = &run.trace;
    let half = &rows[rows.len() / 2..];
    let joints = scenario.arm.links.len();
    let settled = |joint: usize| half.iter().map(|row| row.torque[joint].abs()).fold(0.0, f64::max);
    let quarter = rows.len() / 4;
    let growth = rms(&rows[3 * quarter..]) / rms(&rows[2 * quarter..3 * quarter]);
    let rms_error_m = run.report.rms_error_m;
    Ok(Verification {
        diverged: run.report.diverged,
        rms_error_m,
        peak_torque_nm: run.report.peak_torque_nm,
        settled_torque_nm: (0..joints).map(settled).collect(),
        time_constant_s: rms_error_m.and_then(|floor| time_constant(rows, floor)),
        growth,
    })
}

fn size(row: &Row) -> f64 {
    row.error[0].hypot(row.error[1])
}

fn rms(rows: &[Row]) -> f64 {
    let sum: f64 = rows.iter().map(|row| size(row).powi(2)).sum();
    (sum / rows.len().max(1) as f64).sqrt()
}

/// −1 over the slope of ln‖e‖, from the largest error until it is down to three times the floor.
fn time_constant(rows: &[Row], floor: f64) -> Option<f64> {
    let quarter = &rows[..rows.len() / 4];
    let peak = quarter.iter().enumerate().max_by(|a, b| size(a.1).total_cmp(&size(b.1)))?.0;
    let decay: Vec<(f64, f64)> = quarter[peak..]
        .iter()
        .map(|row| (row.time, size(row)))
        .take_while(|(_, size)| *size > 3.0 * floor)
        .map(|(time, size)| (time, size.ln()))
        .collect();
    let (first, last) = (decay.first()?, decay.last()?);
    // Less than half a time constant tells nothing.
    if decay.len() < 10 || first.1 - last.1 < 0.5 {
        return None;
    }
    let n = decay.len() as f64;
    let (t, y) = decay.iter().fold((0.0, 0.0), |(t, y), p| (t + p.0 / n, y + p.1 / n));
    let (ty, tt) = decay
        .iter()
        .fold((0.0, 0.0), |(ty, tt), p| (ty + (p.0 - t) * (p.1 - y), tt + (p.0 - t) * (p.0 - t)));
    (ty < 0.0).then(|| -tt / ty)
}

impl Verification {
    /// The rms error; infinite for a run that has none.
    pub fn rms(&self) -> f64 {
        if self.diverged { f64::INFINITY } else { self.rms_error_m.unwrap_or(f64::INFINITY) }
    }

    /// What speaks against a proposal that was run at a multiple of the latency.
    pub fn problem(&self, wanted: &Wanted, multiple: f64) -> Option<String> {
        let at =
            if multiple == 1.0 { String::new() } else { format!(" at {multiple} x the latency") };
        if !self.rms().is_finite() {
            return Some(format!("the arm runs away{at}"));
        }
        if self.growth.is_nan() || self.growth > GROWTH {
            return Some(format!("the error still grows at the end{at}"));
        }
        let pairs = self.peak_torque_nm.iter().zip(&wanted.torque_limit_nm);
        (1..).zip(pairs).find(|(_, (peak, limit))| peak > limit).map(|(joint, (peak, limit))| {
            format!("the torque at joint {joint} reaches {peak:.3} of {limit:.3} N m{at}")
        })
    }
}
