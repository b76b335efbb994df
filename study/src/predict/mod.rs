//! The largest latency of a loop, by theory and by measurement.
//!
//! `linear` is the theory, `path` finds the effective masses it needs, `measure` finds the same
//! limit by simulating the arm in full. Both are for a constant regulating factor k: with the
//! paper's factors k falls as the error grows, so that an unstable loop ends in a limit cycle whose
//! size is the error at which k has fallen far enough.

pub(crate) mod linear;
mod measure;
pub(crate) mod path;

use mtj_model::{
    for_axes,
    law::{Equation, factor::FactorKind},
    lift::Lift,
    scenario::{Override, Scenario},
};

use crate::{error::StudyError, sweep::plan::Plan};
use linear::LinearLoop;
pub use path::Masses;

/// The k that goes with errors of about 1 % of the sensitivity thresholds: the factor at which the
/// limits are predicted, unless the scenario's ceiling is lower.
pub const TRUST: f64 = 0.99;

/// Latencies beyond this many seconds are of no interest.
pub const MOST: f64 = 0.5;

/// The keys that are latencies.
pub const LATENCY_KEYS: [&str; 2] = ["link.torque.latency", "link.state.latency"];

/// The prediction for one scenario without latency.
#[derive(Clone, Debug, PartialEq)]
pub struct Prediction {
    /// The constant regulating factor, of a law that has one.
    pub factor: Option<f64>,
    /// Effective masses along the path.
    pub masses: Masses,
    /// Largest latency, s; `None` if the loop is not stable even without.
    pub latency: Option<f64>,
}

/// The constant factor at which a scenario's limits are predicted, for a law that has one.
pub fn factor(scenario: &Scenario) -> Option<f64> {
    let factor = scenario.law.law.factor()?;
    let ceiling = factor.ceiling.unwrap_or(1.0);
    Some(if factor.kind == FactorKind::Constant { ceiling } else { TRUST.min(ceiling) })
}

/// The scenario with its regulating factor held constant at [`factor`].
fn with_constant_factor(scenario: &Scenario) -> Result<Scenario, StudyError> {
    let Some(k) = factor(scenario) else { return Ok(scenario.clone()) };
    let set = [
        Override::text("law.factor.kind", "constant"),
        Override::value("law.factor.ceiling", k.into()),
    ];
    Ok(Scenario::parse(&scenario.name, scenario.text(), &set)?)
}

/// The linear loop of a scenario for one effective mass, without latency.
pub fn linear_loop<const M: usize>(
    scenario: &Scenario,
    mass: f64,
) -> Result<LinearLoop<M>, StudyError> {
    let settings = with_constant_factor(scenario)?.law;
    let law = settings.law.description();
    let no_theory = |reason| Err(StudyError::NoTheory { law: law.name, reason });
    if law.has_state {
        return no_theory("the law keeps a state from sample to sample");
    }
    if settings.predicts_by_model() {
        return no_theory("a model of the arm predicts");
    }
    Ok(LinearLoop {
        law: settings.law.lift::<f64, M>(),
        mass,
        model_mass: settings.mass_scale * mass,
        period: scenario.timing.sample_period.as_secs_f64(),
        latency: 0.0,
        memory: settings.memory.policy,
        predicts: settings.prediction.is_some(),
    })
}

/// Predicts the largest latency: the least over the range of effective masses.
pub fn predict(scenario: &Scenario, proceed: &dyn Fn() -> bool) -> Result<Prediction, StudyError> {
    predict_up_to(scenario, MOST, proceed)
}

/// Predicts the largest latency where it is less than `most` seconds, and `most` where it is not.
pub fn predict_up_to(
    scenario: &Scenario,
    most: f64,
    proceed: &dyn Fn() -> bool,
) -> Result<Prediction, StudyError> {
    let masses = path::masses(&without_latency(scenario)?, proceed)?;
    let mut latency = Some(most);
    for mass in [masses.least, masses.most] {
        let limit = for_axes!(scenario.task, M => {
            linear_loop::<M>(scenario, mass)?.largest_latency(most)
        });
        latency = limit.zip(latency).map(|(a, b)| a.min(b));
    }
    Ok(Prediction { factor: factor(scenario), masses, latency })
}

/// Measures the largest latency of a scenario with its factor held constant at [`factor`], sought
/// from the predicted one outwards.
pub fn measure(
    scenario: &Scenario,
    predicted: Option<f64>,
    proceed: &dyn Fn() -> bool,
) -> Result<Option<f64>, StudyError> {
    let constant = with_constant_factor(scenario)?;
    let guess = predicted.unwrap_or(scenario.timing.sample_period.as_secs_f64() / 10.0);
    measure::largest_latency(&without_latency(&constant)?, guess, MOST, proceed)
}

/// The scenarios of a plan with its latency axis left out, each with the labels of its positions.
pub fn scenarios(plan: &Plan) -> Result<Vec<(Vec<String>, Scenario)>, StudyError> {
    if plan.best.is_some() {
        return Err(StudyError::Searched { name: plan.name.clone() });
    }
    let mut plan = plan.clone();
    let is_latency = |set: &Override| LATENCY_KEYS.contains(&set.path());
    plan.axes
        .retain(|axis| !axis.positions.iter().all(|position| position.set.iter().all(is_latency)));
    (0..plan.len())
        .map(|point| {
            let labels = plan.positions(point).into_iter().map(|p| p.label.clone()).collect();
            Ok((labels, without_latency(&plan.scenario(point)?)?))
        })
        .collect()
}

fn without_latency(scenario: &Scenario) -> Result<Scenario, StudyError> {
    let set = LATENCY_KEYS.map(|key| Override::text(key, "0 s"));
    Ok(Scenario::parse(&scenario.name, scenario.text(), &set)?)
}
