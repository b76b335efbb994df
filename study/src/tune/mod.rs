//! The paper's systematic gain selection: gains, thresholds and memory for a wanted time constant.
//!
//! The ratio K_d/K_p is the error's time constant, eq. (17). The magnitude is the largest that the
//! sample period, the latency and the actuators allow. `limits` computes the limits by theory,
//! `search` simulates the arm to find the least error within them, and `verify` checks the proposal
//! against the requirements, from several starts and with more latency.

mod limits;
pub mod print;
mod reason;
mod search;
mod simulation;
mod values;
mod verify;

use mtj_model::scenario::{Override, Scenario, duration};
use mtj_plant::{
    error::PlantError,
    link::{Direction, Link},
};
use serde::Serialize;
use std::{ops::Range, time::Duration};

use crate::error::StudyError;
pub use crate::margin::MARGIN;
use limits::ArmProperties;
pub use limits::motion;
pub use reason::{GainLimit, Problem, Rejected, Shortfall};
use search::Candidate;
pub use values::{Remedy, Values};
pub use verify::Verification;

/// The starts from which a proposal is verified.
pub const STARTS: usize = 9;
/// How long it is verified, s, or for the scenario's duration if that is longer.
pub const VERIFIED_S: u64 = 60;
/// The starts from which a candidate is simulated in the search.
const SEARCHED: usize = 5;
/// Offset of the other starts from the scenario's own, rad. It changes where a chaotic posture
/// goes, and hardly the torque that the start takes.
const ASIDE: f64 = 1e-3;
/// The fewest latencies that are drawn to tell how they are distributed.
const DRAWS: usize = 4096;
/// The share of the messages that the high latency is not exceeded by.
const QUANTILE: f64 = 0.99;

/// The requirements.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wanted {
    /// K_d/K_p, s.
    pub time_constant_s: f64,
    /// Per joint, N m.
    pub torque_limit_nm: Vec<f64>,
    /// Sample instant to application.
    #[serde(flatten)]
    pub latency: Latency,
    /// Where the latency is from.
    pub latency_source: LatencySource,
}

/// The latency from a sample instant to the application of its torque.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Latency {
    /// On average, s.
    #[serde(rename = "latency_s")]
    pub mean_s: f64,
    /// What 99 % of the messages do not exceed, s.
    #[serde(rename = "latency_p99_s")]
    pub p99_s: f64,
}

/// Where the latency of a proposal is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LatencySource {
    /// The scenario's links, with their jitter, replays and losses.
    Links,
    /// Given, and constant.
    Given,
    /// Measured on a bus and added to the mean of the links, and constant.
    Measured,
}

impl Latency {
    /// One that does not vary.
    pub fn constant(seconds: f64) -> Self {
        Self { mean_s: seconds, p99_s: seconds }
    }

    /// The latency that the linear loop must stand: [`MARGIN`] times the mean, or the high one.
    pub(crate) fn with_margin_s(self) -> f64 {
        self.p99_s.max(MARGIN * self.mean_s)
    }
}

/// A verified proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// The values to set.
    pub values: Values,
    /// The limit on K_d.
    pub gain_limit: GainLimit,
    /// Why this memory, and this mass.
    pub memory_reason: String,
    /// Why these thresholds.
    pub threshold_reason: String,
    /// The candidates that were rejected.
    pub rejected: Vec<Rejected>,
    /// The simulation with the latency, from [`STARTS`] starts and for [`VERIFIED_S`].
    pub verified: Verification,
    /// The simulation with [`MARGIN`] times the latency.
    pub with_margin: Verification,
    /// The scenario before anything is set, with the same latency.
    pub as_it_stands: Verification,
    /// How far the proposal falls short of what is wanted.
    pub shortfalls: Vec<Shortfall>,
}

/// The scenario in lockstep with a multiple of the wanted latency and without a torque limit, so
/// that what the law asks for is seen.
pub fn trial(
    scenario: &Scenario,
    wanted: &Wanted,
    multiple: f64,
    set: &[Override],
) -> Result<Scenario, StudyError> {
    let mut all = vec![
        Override::text("timing.clock", "lockstep"),
        Override::value("safety.torque_limit", 1e9.into()),
    ];
    all.extend(links(scenario, wanted, multiple));
    all.extend_from_slice(set);
    Ok(Scenario::parse(&scenario.name, scenario.text(), &all)?)
}

/// The same from several starts: number 0 is the scenario's own; the others are `ASIDE` from it or
/// less, and draw other random numbers.
pub fn trials(
    scenario: &Scenario,
    wanted: &Wanted,
    multiple: f64,
    set: &[Override],
    starts: Range<usize>,
) -> Result<Vec<Scenario>, StudyError> {
    starts
        .map(|start| {
            let set: Vec<_> = set.iter().cloned().chain(aside(scenario, start)).collect();
            trial(scenario, wanted, multiple, &set)
        })
        .collect()
}

/// The settings of a start: none for number 0, which is the scenario's own.
pub(crate) fn aside(scenario: &Scenario, start: usize) -> Vec<Override> {
    if start == 0 {
        return Vec::new();
    }
    // The signs come round again, so that the distance has to differ.
    let distance = ASIDE / (1 + start / SEARCHED) as f64;
    let aside = |joint| if start >> joint & 1 == 0 { distance } else { -distance };
    let position = scenario.arm.position.iter().enumerate();
    let position: Vec<_> = position.map(|(joint, q)| toml::Value::from(q + aside(joint))).collect();
    // Not added, so that the largest seed stays one.
    let seed = (scenario.seed ^ start as u64) as i64;
    vec![Override::value("arm.position", position.into()), Override::value("seed", seed.into())]
}

/// The settings of the links for a multiple of the wanted latency.
///
/// The links' own latencies, with their jitter and losses, are lengthened by a constant; a latency
/// that is not theirs, or none at all, takes their place, jitter and losses included.
pub fn links(scenario: &Scenario, wanted: &Wanted, multiple: f64) -> Vec<Override> {
    let text = |seconds: f64| duration::format(Duration::from_secs_f64(seconds));
    if wanted.latency_source != LatencySource::Links || multiple == 0.0 {
        let constant = |link: &str, latency: f64| {
            let table = toml::Table::from_iter([("latency".to_owned(), text(latency).into())]);
            Override::value(link, table.into())
        };
        let latency = multiple * wanted.latency.mean_s;
        return vec![constant("link.state", 0.0), constant("link.torque", latency)];
    }
    vec![longer(scenario, (multiple - 1.0) * wanted.latency.mean_s)]
}

/// The setting that makes the links' latency longer by so many seconds.
pub(crate) fn longer(scenario: &Scenario, by: f64) -> Override {
    let own = scenario.link.torque.latency.as_secs_f64();
    let latency = Duration::from_secs_f64((own + by).max(0.0));
    Override::text("link.torque.latency", &duration::format(latency))
}

/// The latency that a scenario's links draw, both directions together: of the messages of one run
/// that arrive, or of more where a run is short.
pub fn link_latency(scenario: &Scenario) -> Result<Latency, StudyError> {
    let links = &scenario.link;
    let open = |settings, direction| {
        Link::new(settings, direction, scenario.seed).map_err(PlantError::from)
    };
    let mut state = open(&links.state, Direction::State)?;
    let mut torque = open(&links.torque, Direction::Torque)?;
    let period = scenario.timing.sample_period.as_secs_f64();
    let samples = (scenario.duration.as_secs_f64() / period) as usize;
    let round = |_| state.transit_ns().zip(torque.transit_ns()).map(|(a, b)| a + b);
    let mut drawn: Vec<u64> = (0..samples.max(DRAWS)).filter_map(round).collect();
    drawn.sort_unstable();
    let Some(last) = drawn.len().checked_sub(1) else { return Ok(Latency::constant(0.0)) };
    let mean_ns = drawn.iter().map(|ns| *ns as f64).sum::<f64>() / drawn.len() as f64;
    let p99_ns = drawn[(QUANTILE * last as f64).round() as usize];
    Ok(Latency { mean_s: mean_ns * 1e-9, p99_s: p99_ns as f64 * 1e-9 })
}

/// Proposes the values with the least error from the worst start, or simpler ones that are nearly
/// as good.
pub fn propose(
    scenario: &Scenario,
    wanted: &Wanted,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Proposal, StudyError> {
    let arm = ArmProperties::of(scenario, wanted, proceed)?;
    arm.check_motion(wanted)?;
    let mut as_it_stands = verify::briefly(scenario, wanted, 1.0, &[], proceed)?;
    if !as_it_stands.diverged {
        as_it_stands = verify::at_length(as_it_stands, scenario, wanted, 1.0, &[], proceed)?;
    }
    let mut rejected = Vec::new();
    let candidates = search::candidates(&arm, wanted, &mut rejected);
    let best = search::best(scenario, wanted, &arm, candidates, &mut rejected, proceed)?;
    let Some((Candidate { values, bound }, verified, with_margin)) = best else {
        return Err(StudyError::NoGains {
            time_constant_s: wanted.time_constant_s,
            last: rejected.pop().map(Into::into),
        });
    };
    Ok(Proposal {
        gain_limit: bound.limit_of(values.kd),
        memory_reason: arm.explain_memory(&values, wanted),
        threshold_reason: arm.explain_thresholds(&values, wanted, &with_margin),
        shortfalls: verify::shortfalls(wanted, &verified, &with_margin),
        values,
        rejected,
        verified,
        with_margin,
        as_it_stands,
    })
}

#[cfg(test)]
mod tests;
