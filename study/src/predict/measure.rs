//! The largest latency by simulation: whether a small disturbance dies out.

use std::time::Duration;

use mtj_model::scenario::{Override, Scenario, duration};
use mtj_plant::trace::TraceRow;

use crate::{error::StudyError, experiment};

/// The distance at which two runs begin, rad: small against every error, large against rounding.
const DISTURBANCE: f64 = 1e-7;

/// The growth of a small disturbance over the second half of a run, as a factor a sample. The run
/// and a second one, which begins a little beside it, are simulated in full. `None` if one of them
/// diverged.
pub(crate) fn growth(
    scenario: &Scenario,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<f64>, StudyError> {
    let position = scenario.arm.position[0] + DISTURBANCE;
    let beside = Override::value("arm.position[0]", position.into());
    let twin = Scenario::parse(&scenario.name, scenario.text(), &[beside])?;
    let run = experiment::run_direct(scenario, true, proceed)?;
    let other = experiment::run_direct(&twin, true, proceed)?;
    if run.report.diverged || other.report.diverged {
        return Ok(None);
    }
    let distances: Vec<f64> =
        run.trace.iter().zip(&other.trace).map(|(a, b)| distance(a, b)).collect();
    let quarter = distances.len() / 4;
    let (middle, end) =
        (mean_log(&distances[quarter..2 * quarter]), mean_log(&distances[3 * quarter..]));
    Ok(Some(((end - middle) / (2 * quarter) as f64).exp()))
}

/// The largest latency, up to `most`, at which a small disturbance still dies out, s, sought from a
/// guess outwards to 2 %; `None` if it does not even without latency.
pub(crate) fn largest_latency(
    scenario: &Scenario,
    guess: f64,
    most: f64,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<f64>, StudyError> {
    let is_stable = |latency: f64| -> Result<bool, StudyError> {
        let latency = duration::format(Duration::from_nanos((latency * 1e9) as u64));
        let set = [Override::text("link.torque.latency", &latency)];
        let scenario = Scenario::parse(&scenario.name, scenario.text(), &set)?;
        Ok(growth(&scenario, proceed)?.is_some_and(|growth| growth < 1.0))
    };
    let (mut below, mut above) = (0.9 * guess, guess);
    while !is_stable(below)? {
        if below < NONE {
            return Ok(if is_stable(0.0)? { Some(0.0) } else { None });
        }
        (below, above) = (0.7 * below, below);
    }
    while is_stable(above)? {
        if above >= most {
            return Ok(Some(most));
        }
        (below, above) = (above, (1.2 * above).min(most));
    }
    while above / below > 1.02 {
        let middle = 0.5 * (below + above);
        if is_stable(middle)? { below = middle } else { above = middle }
    }
    Ok(Some(below))
}

/// A latency that counts as none, s.
const NONE: f64 = 1e-6;

fn distance(a: &TraceRow, b: &TraceRow) -> f64 {
    (a.tip[0] - b.tip[0]).hypot(a.tip[1] - b.tip[1])
}

fn mean_log(distances: &[f64]) -> f64 {
    // Below rounding there is nothing to see.
    distances.iter().map(|d| d.max(1e-16).ln()).sum::<f64>() / distances.len().max(1) as f64
}
