//! The paper's systematic gain selection: gains, thresholds and memory from what is wanted.
//!
//! The ratio K_d/K_p is the error's time constant, eq. (17). The magnitude is the largest that the
//! sample period, the latency and the actuators allow: [`limits`] says what theory allows,
//! [`verify`] what a simulation of the arm does with it, and [`propose`] goes down from the first
//! until the second agrees.

pub mod limits;
pub mod print;
pub mod verify;

use mtj_model::scenario::{MemoryPolicy, Override, Scenario, duration};
use mtj_plant::link::{Direction, Link};
use serde::Serialize;
use std::time::Duration;

use crate::{failure::Failure, sweep::lanes};
use limits::Arm;
use verify::Verification;

/// The loop must stand this many times the latency.
pub const MARGIN: f64 = 1.5;
/// K_d is lowered by this factor from try to try.
const LOWER: f64 = 0.85;
/// How many values of K_d are tried for a remedy.
const GAINS: usize = 8;
/// How many of the best candidates are verified, at the most.
const VERIFIED: usize = 64;
/// How many that stand the test are enough to choose from.
const ENOUGH: usize = 16;
/// e_max as multiples of the initial error, tried in turn; the first makes k nearly one.
const THRESHOLDS: [f64; 4] = [1000.0, 30.0, 10.0, 3.0];
/// ė_max/e_max, 1/s: the paper's.
const RATE_RATIO: f64 = 10.0;
/// How many latencies are drawn for their mean.
const DRAWS: usize = 4096;
/// A simpler remedy is preferred if its error is at most this many times as large.
const AS_GOOD: f64 = 1.05;

/// What is wanted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Wanted {
    /// K_d/K_p, s.
    pub time_constant_s: f64,
    /// Per joint, N m.
    pub torque_limit_nm: Vec<f64>,
    /// Sample instant to application, s.
    pub latency_s: f64,
    /// Whether the latency is another than the scenario's own.
    #[serde(skip)]
    pub sets_latency: bool,
}

/// What makes the law stand latency: whose task force it remembers, and what it does besides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remedy {
    /// Whose task force.
    pub policy: MemoryPolicy,
    /// M̄ of eq. (11) over the least effective mass; `None` for eq. (16).
    pub mass_ratio: Option<f64>,
    /// Whether the law aims a measured latency ahead.
    pub predicts: bool,
}

/// Ratios M̄/m that are tried: the inner loop of eq. (11) is stable below 2, and a small one stands little
/// latency with the memory of what was sent and asks less of the actuator.
const MASS_RATIOS: [f64; 6] = [1.4, 1.2, 1.0, 0.8, 0.5, 0.3];

/// Every remedy that may be proposed, the simplest first.
pub fn remedies() -> Vec<Remedy> {
    let sent = Remedy { policy: MemoryPolicy::Sent, mass_ratio: None, predicts: false };
    let delivered = Remedy { policy: MemoryPolicy::Delivered, ..sent };
    let with_mass =
        |remedy: Remedy| MASS_RATIOS.map(|ratio| Remedy { mass_ratio: Some(ratio), ..remedy });
    let mut all = vec![sent, delivered];
    all.extend(with_mass(sent));
    all.extend(with_mass(delivered));
    all.push(Remedy { predicts: true, ..delivered });
    all
}

impl Remedy {
    /// The policy's name in scenarios.
    pub fn policy_name(self) -> &'static str {
        match self.policy {
            MemoryPolicy::Sent => "sent",
            MemoryPolicy::Applied => "applied",
            MemoryPolicy::Delivered => "delivered",
        }
    }

    /// The name in print.
    pub fn name(self) -> String {
        let besides = match (self.mass_ratio, self.predicts) {
            (Some(_), true) => ", with eq. (11) and prediction",
            (Some(_), false) => ", with eq. (11)",
            (None, true) => ", with prediction",
            (None, false) => "",
        };
        let at =
            self.mass_ratio.map_or(String::new(), |ratio| format!(" at {ratio} x the least mass"));
        format!("{}{besides}{at}", self.policy_name())
    }
}

/// The values to set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Values {
    /// N/m.
    pub kp: f64,
    /// N s/m.
    pub kd: f64,
    /// M̄ of eq. (11), kg; `None` for eq. (16).
    pub mass: Option<f64>,
    /// e_max, m.
    pub error: f64,
    /// ė_max, m/s.
    pub error_rate: f64,
    /// Whose force is remembered, and what else helps.
    pub remedy: Remedy,
}

/// A verified proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// What to set.
    pub values: Values,
    /// What limits K_d.
    pub gain_reason: String,
    /// Why this memory, and this mass.
    pub memory_reason: String,
    /// Why these thresholds.
    pub threshold_reason: String,
    /// What was tried and given up on the way.
    pub given_up: Vec<String>,
    /// The simulation with the latency.
    pub verified: Verification,
    /// The simulation with [`MARGIN`] times the latency.
    pub with_margin: Verification,
    /// The scenario before anything is set, with the same latency.
    pub as_it_stands: Verification,
}

/// The scenario in lockstep with a multiple of the wanted latency and without a torque limit, so that
/// what the law asks for is seen.
pub fn trial(
    scenario: &Scenario,
    wanted: &Wanted,
    multiple: f64,
    set: &[Override],
) -> Result<Scenario, Failure> {
    let mut all = vec![
        Override::text("timing.clock", "lockstep"),
        Override::value("safety.torque_limit", 1e9.into()),
    ];
    all.extend(links(scenario, wanted, multiple));
    all.extend_from_slice(set);
    Ok(Scenario::parse(&scenario.name, scenario.text(), &all)?)
}

/// The settings of the links for a multiple of the wanted latency.
///
/// The links' own latencies, with their jitter and losses, are lengthened by a constant; a latency that is
/// wanted instead of theirs, or none at all, takes their place.
pub fn links(scenario: &Scenario, wanted: &Wanted, multiple: f64) -> Vec<Override> {
    let text = |seconds: f64| duration::format(Duration::from_secs_f64(seconds));
    if wanted.sets_latency || multiple == 0.0 {
        let constant = |link: &str, latency: f64| {
            let table = toml::Table::from_iter([("latency".to_owned(), text(latency).into())]);
            Override::value(link, table.into())
        };
        let latency = multiple * wanted.latency_s;
        return vec![constant("link.state", 0.0), constant("link.torque", latency)];
    }
    let own = scenario.link.torque.latency.as_secs_f64();
    let longer = own + (multiple - 1.0) * wanted.latency_s;
    vec![Override::text("link.torque.latency", &text(longer))]
}

/// The mean latency of a scenario's links, both directions together, s.
pub fn mean_latency(scenario: &Scenario) -> Result<f64, Failure> {
    let mean = |settings, direction| -> Result<f64, Failure> {
        let mut link = Link::new(settings, direction, scenario.seed)?;
        let arrived: Vec<f64> = (0..DRAWS)
            .filter_map(|_| link.transit_ns())
            .map(|transit_ns| transit_ns as f64 * 1e-9)
            .collect();
        Ok(arrived.iter().sum::<f64>() / arrived.len().max(1) as f64)
    };
    let links = &scenario.link;
    Ok(mean(&links.state, Direction::State)? + mean(&links.torque, Direction::Torque)?)
}

impl Values {
    fn new(kd: f64, error: f64, remedy: Remedy, arm: &Arm, wanted: &Wanted) -> Self {
        let kp = kd / wanted.time_constant_s;
        let mass = arm.mass(remedy).map(round_down);
        Self { kp, kd, mass, error, error_rate: RATE_RATIO * error, remedy }
    }

    /// The same as settings of a scenario.
    pub fn overrides(&self, scenario: &Scenario) -> Vec<Override> {
        let mut set = vec![
            Override::text("law.kind", "mtj"),
            Override::value("law.kp", self.kp.into()),
            Override::value("law.kd", self.kd.into()),
            Override::value("law.acceleration", self.mass.is_some().into()),
            Override::text("law.factor.kind", "exponential"),
            Override::value("law.factor.error", self.error.into()),
            Override::value("law.factor.error_rate", self.error_rate.into()),
            Override::value("law.factor.ceiling", 1.0.into()),
            Override::text("law.memory.policy", self.remedy.policy_name()),
        ];
        set.extend(self.mass.map(|mass| Override::value("law.mass", mass.into())));
        if self.remedy.predicts {
            set.push(Override::text("law.prediction.horizon", "measured"));
        } else if scenario.law.prediction.is_some() {
            set.push(Override::text("law.prediction.horizon", "none"));
        }
        set
    }
}

/// A positive number rounded down to two significant digits.
fn round_down(x: f64) -> f64 {
    let unit = 10f64.powf(x.log10().floor() - 1.0);
    let digits = (x / unit + 1e-9).floor();
    // Divided by a whole number, so that 0.3 is printed as 0.3.
    if unit < 1.0 { digits / (1.0 / unit).round() } else { digits * unit.round() }
}

/// Values to try, and what limits their K_d.
struct Candidate {
    values: Values,
    gain_reason: String,
}

/// A candidate that stands the test.
struct Verified {
    candidate: Candidate,
    with_latency: Verification,
    with_margin: Verification,
}

/// Searches remedies, gains and thresholds for the least error, verifies the best, and proposes the
/// simplest of those that are nearly as good as the best of them.
pub fn propose(
    scenario: &Scenario,
    wanted: &Wanted,
    proceed: &dyn Fn() -> bool,
) -> Result<Proposal, Failure> {
    let arm = Arm::of(scenario, wanted, proceed)?;
    arm.check_motion(wanted)?;
    let as_it_stands = verify::run(&trial(scenario, wanted, 1.0, &[])?, proceed)?;
    let mut given_up = Vec::new();
    let candidates = candidates(&arm, wanted, &mut given_up);
    let ranked = rank(scenario, wanted, candidates, proceed)?;
    let verified = verify_best(scenario, wanted, ranked, &mut given_up, proceed)?;
    let rms = |of: &Verified| of.with_latency.rms();
    let least = verified.iter().map(rms).fold(f64::INFINITY, f64::min);
    let order = remedies();
    let place = |of: &Verified| order.iter().position(|one| *one == of.candidate.values.remedy);
    let is_as_good = |of: &Verified| rms(of) <= AS_GOOD * least;
    let Some(best) = verified.into_iter().filter(is_as_good).min_by_key(place) else {
        return Err(Failure::from(format!(
            "none of the gains tried with K_d/K_p = {} s satisfies all limits; in the way at the last: {}",
            wanted.time_constant_s,
            given_up.last().map_or("nothing", String::as_str)
        )));
    };
    let Candidate { values, gain_reason } = best.candidate;
    Ok(Proposal {
        memory_reason: arm.explain_memory(&values, wanted),
        threshold_reason: arm.explain_thresholds(&values, wanted),
        values,
        gain_reason,
        given_up,
        verified: best.with_latency,
        with_margin: best.with_margin,
        as_it_stands,
    })
}

/// All combinations of remedies, gains and thresholds that theory allows.
fn candidates(arm: &Arm, wanted: &Wanted, given_up: &mut Vec<String>) -> Vec<Candidate> {
    let allowed = arm.gain_limit(wanted);
    let mut candidates = Vec::new();
    for remedy in remedies() {
        let bound = match arm.gain_for_remedy(remedy, wanted, allowed.kd) {
            Ok(bound) => bound,
            Err(reason) => {
                given_up.push(format!("{}: {reason}", remedy.name()));
                continue;
            }
        };
        let limit = bound.reason.unwrap_or_else(|| allowed.reason.clone());
        for step in 0..GAINS {
            let kd = round_down(bound.kd * LOWER.powi(step as i32));
            let gain_reason = match step {
                0 => limit.clone(),
                _ => format!("simulation: the best of the gains up to {}", round_down(bound.kd)),
            };
            candidates.extend(THRESHOLDS.map(|multiple| {
                let error = round_down(multiple * arm.initial_error);
                let values = Values::new(kd, error, remedy, arm, wanted);
                Candidate { values, gain_reason: gain_reason.clone() }
            }));
        }
    }
    candidates
}

/// Simulates all candidates side by side; those that do not run away within the torque limit, the least
/// error first.
fn rank(
    scenario: &Scenario,
    wanted: &Wanted,
    candidates: Vec<Candidate>,
    proceed: &dyn Fn() -> bool,
) -> Result<Vec<Candidate>, Failure> {
    let auto = Override::text("timing.integration_step", "auto");
    let scenarios = candidates
        .iter()
        .map(|candidate| {
            let mut set = candidate.values.overrides(scenario);
            set.push(auto.clone());
            trial(scenario, wanted, 1.0, &set)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut errors = vec![f64::INFINITY; candidates.len()];
    lanes::measure(&scenarios, proceed, &mut |number, measured| {
        let Ok(report) = measured else { return };
        let is_within = |(peak, limit): (&f64, &f64)| peak <= limit;
        if report.peak_torque_nm.iter().zip(&wanted.torque_limit_nm).all(is_within) {
            errors[number] = report.rms_error_m.unwrap_or(f64::INFINITY);
        }
    });
    if !proceed() {
        return Err(Failure::from("stopped before a proposal was verified".to_owned()));
    }
    let mut ranked: Vec<_> = errors.into_iter().zip(candidates).collect();
    ranked.retain(|(error, _)| error.is_finite());
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    Ok(ranked.into_iter().map(|(_, candidate)| candidate).collect())
}

/// Verifies the best candidates with the latency and with [`MARGIN`] times it, until there are enough.
fn verify_best(
    scenario: &Scenario,
    wanted: &Wanted,
    ranked: Vec<Candidate>,
    given_up: &mut Vec<String>,
    proceed: &dyn Fn() -> bool,
) -> Result<Vec<Verified>, Failure> {
    let mut verified = Vec::new();
    for candidate in ranked.into_iter().take(VERIFIED) {
        if verified.len() == ENOUGH {
            break;
        }
        let set = candidate.values.overrides(scenario);
        let run = |latency| verify::run(&trial(scenario, wanted, latency, &set)?, proceed);
        let (with_latency, with_margin) = (run(1.0)?, run(MARGIN)?);
        if !proceed() {
            return Err(Failure::from("stopped before a proposal was verified".to_owned()));
        }
        let problem = with_latency.problem(wanted, 1.0);
        match problem.or_else(|| with_margin.problem(wanted, MARGIN)) {
            None => verified.push(Verified { candidate, with_latency, with_margin }),
            Some(why) => {
                let Values { remedy, kd, .. } = candidate.values;
                given_up.push(format!("{}, K_d = {kd}: {why}", remedy.name()));
            }
        }
    }
    Ok(verified)
}

#[cfg(test)]
mod tests;
