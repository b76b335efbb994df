//! Verifies a proposal by simulations of the arm.

use std::time::Duration;

use mtj_model::scenario::{Override, Scenario, duration};
use mtj_plant::{report::Report, trace::TraceRow};
use serde::Serialize;

use super::{
    MARGIN, SEARCHED, STARTS, VERIFIED_S, Wanted,
    reason::{Problem, Shortfall},
    simulation, trials,
};
use crate::{error::StudyError, experiment};

/// The measures of simulations that differ in their start, the first from the scenario's own.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verification {
    /// Whether the arm ran away, from any start.
    pub diverged: bool,
    /// From the scenario's own start, over the second half of the run, m.
    pub rms_error_m: Option<f64>,
    /// The median over the starts, m.
    pub median_rms_error_m: Option<f64>,
    /// The largest over the starts, m.
    pub worst_rms_error_m: Option<f64>,
    /// The largest over the whole run and over the starts, per joint, N m.
    pub peak_torque_nm: Vec<f64>,
    /// The same over the second half of the scenario's duration.
    pub settled_torque_nm: Vec<f64>,
    /// Of the initial decay, s; null where the error does not decay far enough to tell.
    pub time_constant_s: Option<f64>,
    /// rms error of the last quarter over that of the one before: the median over the starts,
    /// because on a redundant arm without damping it differs from start to start.
    pub growth: f64,
}

/// The measures of one simulation.
struct Run {
    rms: f64,
    peak_torque: Vec<f64>,
    settled_torque: Vec<f64>,
    time_constant: Option<f64>,
    growth: f64,
}

/// An error that grows by more than this from the third quarter to the last is not stable.
const GROWTH: f64 = 1.5;

/// Runs a scenario in lockstep from each of its starts.
pub(crate) fn run(
    starts: &[Scenario],
    proceed: &dyn Fn() -> bool,
) -> Result<Verification, StudyError> {
    let runs =
        starts.iter().map(|start| simulate(start, proceed)).collect::<Result<Vec<_>, _>>()?;
    let sorted = |of: fn(&Run) -> f64| {
        let mut list: Vec<_> = runs.iter().map(of).collect();
        list.sort_by(f64::total_cmp);
        list
    };
    let (rms, growth) = (sorted(|run| run.rms), sorted(|run| run.growth));
    let largest = |of: fn(&Run) -> &[f64]| {
        let joints = of(&runs[0]).len();
        (0..joints).map(|i| runs.iter().map(|run| of(run)[i]).fold(0.0, f64::max)).collect()
    };
    let known = |rms: f64| rms.is_finite().then_some(rms);
    Ok(Verification {
        diverged: rms.iter().any(|rms| rms.is_infinite()),
        rms_error_m: known(runs[0].rms),
        median_rms_error_m: known(rms[rms.len() / 2]),
        worst_rms_error_m: known(rms[rms.len() - 1]),
        peak_torque_nm: largest(|run| &run.peak_torque),
        settled_torque_nm: largest(|run| &run.settled_torque),
        time_constant_s: runs[0].time_constant,
        growth: growth[growth.len() / 2],
    })
}

/// Runs a scenario with something set at a multiple of the latency, from the starts of the search
/// and by the scalar path.
pub(crate) fn briefly(
    scenario: &Scenario,
    wanted: &Wanted,
    multiple: f64,
    set: &[Override],
    proceed: &dyn Fn() -> bool,
) -> Result<Verification, StudyError> {
    run(&trials(scenario, wanted, multiple, set, 0..SEARCHED)?, proceed)
}

/// The same from all starts and at length, in lanes; adds to what was found `briefly`.
pub(crate) fn at_length(
    briefly: Verification,
    scenario: &Scenario,
    wanted: &Wanted,
    multiple: f64,
    set: &[Override],
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Verification, StudyError> {
    let long = scenario.duration.max(Duration::from_secs(VERIFIED_S));
    let mut set = set.to_vec();
    set.extend([
        Override::text("duration", &duration::format(long)),
        Override::text("timing.integration_step", "auto"),
    ]);
    let starts = trials(scenario, wanted, multiple, &set, 0..STARTS)?;
    Ok(briefly.extended(simulation::reports(&starts, proceed)))
}

/// The measured time constant may be off by this part: the decay is not exactly exponential.
const NEAR: f64 = 0.25;
/// Errors that differ by a larger factor are told.
const ALIKE: f64 = 2.0;

/// How a verified proposal falls short.
pub(crate) fn shortfalls(
    wanted: &Wanted,
    verified: &Verification,
    with_margin: &Verification,
) -> Vec<Shortfall> {
    let tau = wanted.time_constant_s;
    let time_constant = match verified.time_constant_s {
        None => Some(Shortfall::Unknown { wanted: tau }),
        Some(found) if (found / tau - 1.0).abs() > NEAR => {
            Some(Shortfall::TimeConstant { found, wanted: tau })
        }
        Some(_) => None,
    };
    let (worst, error) = (verified.worst(), with_margin.worst());
    // An arm that runs away is a problem of its own.
    let is_told = |ratio: f64| ratio > ALIKE && ratio.is_finite();
    let ratio = error / worst;
    let margin = is_told(ratio).then_some(Shortfall::Margin { error, ratio });
    let ratio = worst / verified.median_rms_error_m.unwrap_or(worst);
    let spread = is_told(ratio).then_some(Shortfall::Spread { ratio });
    let at_length = problem(wanted, verified, with_margin);
    let at_length = at_length.map(|problem| Shortfall::AtLength { problem });
    at_length.into_iter().chain(time_constant).chain(margin).chain(spread).collect()
}

/// The problem with a candidate, at the latency or at [`MARGIN`] times it.
pub(crate) fn problem(
    wanted: &Wanted,
    with_latency: &Verification,
    with_margin: &Verification,
) -> Option<Problem> {
    with_latency.problem(wanted, 1.0).or_else(|| with_margin.problem(wanted, MARGIN))
}

fn simulate(scenario: &Scenario, proceed: &dyn Fn() -> bool) -> Result<Run, StudyError> {
    let run = experiment::run_direct(scenario, true, proceed)?;
    let rows = &run.trace;
    let half = &rows[rows.len() / 2..];
    let joints = scenario.arm.links.len();
    let settled = |joint: usize| half.iter().map(|row| row.torque[joint].abs()).fold(0.0, f64::max);
    let quarter = rows.len() / 4;
    let growth = rms(&rows[3 * quarter..]) / rms(&rows[2 * quarter..3 * quarter]);
    let floor = run.report.rms_error_m.filter(|_| !run.report.diverged);
    Ok(Run {
        rms: floor.unwrap_or(f64::INFINITY),
        peak_torque: run.report.peak_torque_nm,
        settled_torque: (0..joints).map(settled).collect(),
        time_constant: floor.and_then(|floor| time_constant(rows, floor)),
        growth,
    })
}

fn size(row: &TraceRow) -> f64 {
    row.error[0].hypot(row.error[1])
}

fn rms(rows: &[TraceRow]) -> f64 {
    let sum: f64 = rows.iter().map(|row| size(row).powi(2)).sum();
    (sum / rows.len().max(1) as f64).sqrt()
}

/// −1 over the slope of ln‖e‖, from the largest error until it is down to three times the floor.
fn time_constant(rows: &[TraceRow], floor: f64) -> Option<f64> {
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
    /// The same with errors and peak torques of longer runs from the starts; the first is the
    /// scenario's own.
    fn extended(mut self, reports: Vec<Option<Report>>) -> Self {
        let error = |report: &Option<Report>| {
            report.as_ref().filter(|report| !report.diverged)?.rms_error_m
        };
        let errors: Vec<Option<f64>> = reports.iter().map(error).collect();
        let mut sorted: Vec<f64> = errors.iter().map(|e| e.unwrap_or(f64::INFINITY)).collect();
        sorted.sort_by(f64::total_cmp);
        let known = |rms: f64| rms.is_finite().then_some(rms);
        self.diverged |= errors.contains(&None);
        self.rms_error_m = errors[0];
        self.median_rms_error_m = known(sorted[sorted.len() / 2]);
        self.worst_rms_error_m = known(sorted[sorted.len() - 1]);
        for report in reports.iter().flatten() {
            for (peak, torque) in self.peak_torque_nm.iter_mut().zip(&report.peak_torque_nm) {
                *peak = peak.max(*torque);
            }
        }
        self
    }

    /// The largest rms error over the starts; infinite if the arm runs away from one.
    pub fn worst(&self) -> f64 {
        self.worst_rms_error_m.unwrap_or(f64::INFINITY)
    }

    /// What is wrong with a proposal that was run at a multiple of the latency.
    pub(crate) fn problem(&self, wanted: &Wanted, multiple: f64) -> Option<Problem> {
        if self.diverged {
            return Some(Problem::Diverges { multiple });
        }
        if self.growth.is_nan() || self.growth > GROWTH {
            return Some(Problem::Grows { multiple });
        }
        let mut pairs = (1..).zip(self.peak_torque_nm.iter().zip(&wanted.torque_limit_nm));
        let (joint, (peak, limit)) = pairs.find(|(_, (peak, limit))| peak > limit)?;
        Some(Problem::Torque { joint, peak: *peak, limit: *limit, multiple })
    }
}
