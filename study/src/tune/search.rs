//! The search for the least error.
//!
//! All combinations that theory allows are simulated in lanes from one start, the best from
//! several, and the best of those are varied. The best after that are verified: by the scalar path,
//! and from more starts and for longer in lanes.

use std::ops::Range;

use mtj_model::scenario::{Override, Scenario};
use mtj_plant::report::Report;

use super::{
    MARGIN, SEARCHED, Wanted,
    limits::{ArmProperties, Bound},
    reason::Rejected,
    simulation, trials,
    values::{Remedy, THRESHOLDS, Values, remedies, round, round_down},
    verify::{self, Verification, problem},
};
use crate::error::StudyError;

/// K_d is lowered by this factor from try to try.
const LOWER: f64 = 0.85;
/// How many values of K_d are tried for a remedy.
const GAINS: usize = 8;
/// How many of the best candidates from one start are simulated from all.
const FINALISTS: usize = 48;
/// How many of the best are varied, and how often.
const VARIED: usize = 8;
const ROUNDS: usize = 2;
/// By what factor K_d and M̄ are varied.
const STEP: f64 = 1.1;
/// How many of the best candidates are verified, at the most.
const VERIFIED: usize = 24;
/// How many that stand the test are enough to choose from.
const ENOUGH: usize = 6;
/// A remedy of fewer parts is preferred if its error is at most this many times as large.
const AS_GOOD: f64 = 1.05;

/// Values to try.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// The values.
    pub values: Values,
    /// The largest K_d that theory allows the remedy, and what limits it.
    pub bound: Bound,
}

impl Candidate {
    /// The same with a little less and a little more of K_d and of M̄.
    fn variations(&self, arm: &ArmProperties, wanted: &Wanted) -> Vec<Self> {
        let Values { kd, error, remedy, .. } = self.values;
        let around = |x: f64| [round(x / STEP), round(x * STEP)];
        let kds = around(kd).into_iter().filter(|kd| *kd <= self.bound.kd).map(|kd| (kd, remedy));
        let masses = remedy.mass.map(around).into_iter().flatten();
        let masses = masses.map(|mass| (kd, Remedy { mass: Some(mass), ..remedy }));
        kds.chain(masses)
            .filter(|(kd, remedy)| arm.stands(*kd, *remedy, wanted))
            .map(|(kd, remedy)| Values::new(kd, error, remedy, wanted))
            .map(|values| Self { values, bound: self.bound })
            .collect()
    }
}

/// All combinations of remedies, gains and thresholds that theory allows.
pub(crate) fn candidates(
    arm: &ArmProperties,
    wanted: &Wanted,
    rejected: &mut Vec<Rejected>,
) -> Vec<Candidate> {
    let allowed = arm.gain_limit(wanted);
    let mut candidates = Vec::new();
    for remedy in remedies(arm.masses.least) {
        let bound = match arm.gain_for_remedy(remedy, wanted, allowed) {
            Ok(bound) => bound,
            Err(reason) => {
                rejected.push(reason);
                continue;
            }
        };
        for step in 0..GAINS {
            let kd = round_down(bound.kd * LOWER.powi(step as i32));
            candidates.extend(THRESHOLDS.map(|multiple| {
                let error = round_down(multiple * arm.initial_error);
                let values = Values::new(kd, error, remedy, wanted);
                Candidate { values, bound }
            }));
        }
    }
    candidates
}

/// The best of the candidates and of those that are like them, with what was measured of it at the
/// latency and at [`MARGIN`] times it; `None` if none stands the test for the scenario's duration.
/// Those that stand it at length are preferred.
pub(crate) fn best(
    scenario: &Scenario,
    wanted: &Wanted,
    arm: &ArmProperties,
    candidates: Vec<Candidate>,
    rejected: &mut Vec<Rejected>,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Option<(Candidate, Verification, Verification)>, StudyError> {
    let rank = |candidates, starts| rank(scenario, wanted, candidates, starts, proceed);
    let first = candidates.first().cloned();
    let finalists = rank(candidates, 0..1)?.into_iter().take(FINALISTS);
    let mut ranked = rank(finalists.map(|(_, candidate)| candidate).collect(), 0..SEARCHED)?;
    for _ in 0..ROUNDS {
        let leading = ranked.iter().take(VARIED);
        let varied = leading.flat_map(|(_, candidate)| candidate.variations(arm, wanted)).collect();
        ranked.extend(rank(varied, 0..SEARCHED)?);
        ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        ranked.dedup_by(|(_, a), (_, b)| a.values == b.values);
    }
    if ranked.is_empty() {
        // Its verification says what is wrong.
        ranked.extend(first.map(|first| (f64::INFINITY, first)));
    }
    let (mut verified, mut imperfect) = (Vec::new(), Vec::new());
    for (_, candidate) in ranked.into_iter().take(VERIFIED) {
        if verified.len() == ENOUGH || verified.len() + imperfect.len() == 2 * ENOUGH {
            break;
        }
        let set = candidate.values.overrides(scenario);
        let briefly = |multiple| verify::briefly(scenario, wanted, multiple, &set, proceed);
        let (with_latency, with_margin) = (briefly(1.0)?, briefly(MARGIN)?);
        if let Some(problem) = problem(wanted, &with_latency, &with_margin) {
            let Values { remedy, kd, .. } = candidate.values;
            rejected.push(Rejected { remedy, kd: Some(kd), problem });
            continue;
        }
        let at_length =
            |found, multiple| verify::at_length(found, scenario, wanted, multiple, &set, proceed);
        let (with_latency, with_margin) =
            (at_length(with_latency, 1.0)?, at_length(with_margin, MARGIN)?);
        check(proceed)?;
        let list = match problem(wanted, &with_latency, &with_margin) {
            None => &mut verified,
            Some(_) => &mut imperfect,
        };
        list.push((candidate, with_latency, with_margin));
    }
    // A redundant arm without damping may gather speed for longer than the scenario lasts.
    let mut found = if verified.is_empty() { imperfect } else { verified };
    found.sort_by(|(_, a, _), (_, b, _)| a.worst().total_cmp(&b.worst()));
    let least = found.first().map_or(f64::INFINITY, |(_, least, _)| least.worst());
    found.retain(|(_, found, _)| found.worst() <= AS_GOOD * least);
    Ok(found.into_iter().min_by_key(|(candidate, ..)| candidate.values.remedy.parts()))
}

/// Simulates candidates side by side from some starts, at the latency and at [`MARGIN`] times it;
/// returns those that stay within the torque limit, with their largest error at the latency, the
/// least first.
fn rank(
    scenario: &Scenario,
    wanted: &Wanted,
    candidates: Vec<Candidate>,
    starts: Range<usize>,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Vec<(f64, Candidate)>, StudyError> {
    let auto = Override::text("timing.integration_step", "auto");
    let mut scenarios = Vec::new();
    for candidate in &candidates {
        let mut set = candidate.values.overrides(scenario);
        set.push(auto.clone());
        for multiple in [1.0, MARGIN] {
            scenarios.extend(trials(scenario, wanted, multiple, &set, starts.clone())?);
        }
    }
    let reports = simulation::reports(&scenarios, proceed);
    check(proceed)?;
    let error = |report: Option<Report>| {
        let is_within = |(peak, limit): (&f64, &f64)| peak <= limit;
        let within = |report: &Report| {
            report.peak_torque_nm.iter().zip(&wanted.torque_limit_nm).all(is_within)
        };
        report.filter(within).and_then(|report| report.rms_error_m).unwrap_or(f64::INFINITY)
    };
    let errors: Vec<f64> = reports.into_iter().map(error).collect();
    let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
    let mut ranked = Vec::new();
    for (errors, candidate) in errors.chunks(2 * starts.len()).zip(candidates) {
        let (with_latency, with_margin) = errors.split_at(starts.len());
        if worst(with_latency).is_finite() && worst(with_margin).is_finite() {
            ranked.push((worst(with_latency), candidate));
        }
    }
    ranked.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    Ok(ranked)
}

/// Whether to go on.
fn check(proceed: &dyn Fn() -> bool) -> Result<(), StudyError> {
    if proceed() {
        return Ok(());
    }
    Err(StudyError::Stopped("a proposal was verified"))
}
