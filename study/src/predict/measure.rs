//! The same limit, measured: does a small disturbance die out?

use std::time::Duration;

use mtj_model::scenario::{Override, Scenario, duration};
use mtj_plant::trace::Row;

use crate::{command::Failure, experiment};

/// How far apart two runs begin, rad: small against every error, large against rounding.
const DISTURBANCE: f64 = 1e-7;

/// How fast a small disturbance grows over the second half of a run, as a factor a sample; the run and
/// its twin, which begins a little beside it, are simulated in full. `None` if one of them diverged.
pub fn growth(scenario: &Scenario, proceed: &dyn Fn() -> bool) -> Result<Option<f64>, Failure> {
    let position = scenario.arm.position[0] + DISTURBANCE;
    let beside = Override::value("arm.position[0]", position.into());
    let twin = Scenario::parse(&scenario.name, scenario.text(), &[beside])?;
    let run = experiment::run_direct(scenario, true, proceed)?;
    let other = experiment::run_direct(&twin, true, proceed)?;
    if run.report.diverged || other.report.diverged {
        return Ok(None);
    }
    let apart: Vec<f64> = run.trace.iter().zip(&other.trace).map(|(a, b)| distance(a, b)).collect();
    let quarter = apart.len() / 4;
    let (middle, end) = (mean_log(&apart[quarter..2 * quarter]), mean_log(&apart[3 * quarter..]));
    Ok(Some(((end - middle) / (2 * quarter) as f64).exp()))
}

/// The smallest latency, up to `most`, at which a small disturbance no longer dies out, s; `None` if it
/// does not even without latency.
pub fn largest_latency(
    scenario: &Scenario,
    most: f64,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<f64>, Failure> {
    let is_stable = |latency: f64| -> Result<bool, Failure> {
        let latency = duration::format(Duration::from_nanos((latency * 1e9) as u64));
        let set = [Override::text("link.torque.latency", &latency)];
        let scenario = Scenario::parse(&scenario.name, scenario.text(), &set)?;
        Ok(growth(&scenario, proceed)?.is_some_and(|growth| growth < 1.0))
    };
    if !is_stable(0.0)? {
        return Ok(None);
    }
    let stride = scenario.timing.sample_period.as_secs_f64() / 10.0;
    let (mut below, mut above) = (0.0, stride.min(most));
    while is_stable(above)? {
        if above >= most {
            return Ok(Some(most));
        }
        (below, above) = (above, (above * 1.3).min(most));
    }
    for _ in 0..7 {
        let middle = 0.5 * (below + above);
        if is_stable(middle)? { below = middle } else { above = middle }
    }
    Ok(Some(below))
}

fn distance(a: &Row, b: &Row) -> f64 {
    (a.tip[0] - b.tip[0]).hypot(a.tip[1] - b.tip[1])
}

fn mean_log(distances: &[f64]) -> f64 {
    // Below rounding there is nothing to see.
    distances.iter().map(|d| d.max(1e-16).ln()).sum::<f64>() / distances.len().max(1) as f64
}
