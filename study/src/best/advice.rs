//! Which law to take for one loop, and with which gains.

use std::{
    num::NonZero,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use mtj_model::scenario::Override;
use toml::Table;

use super::{Found, Limits, search};
use crate::{
    error::StudyError,
    sweep::{builtin, plan::Plan},
};

/// The loop that advice is about.
#[derive(Clone, Debug, PartialEq)]
pub struct Question {
    /// A built-in scenario or a file.
    pub scenario: String,
    /// What is set in it.
    pub set: Vec<Override>,
    /// The largest torque, N m: one number, or one a joint.
    pub torque_limit_nm: Vec<f64>,
    /// The largest rms torque step, N m; that of the built-in study `best` unless given.
    pub torque_step_limit_nm: Option<f64>,
    /// Every candidate is run in each case, and the worst counts.
    pub cases: Vec<Vec<Override>>,
}

/// What was found for all laws.
#[derive(Debug)]
pub struct Advice {
    /// The limits that were kept.
    pub limits: Limits,
    /// The laws that keep them, the least error first.
    pub laws: Vec<Advised>,
    /// The laws of which no gains do, or which do not suit the arm.
    pub others: Vec<Advised>,
}

/// What was found for a law.
#[derive(Debug)]
pub struct Advised {
    /// Its name in the built-in study `best`.
    pub law: String,
    /// Its best gains, or why it could not be run.
    pub found: Result<Found, StudyError>,
}

impl Advised {
    /// The rms error, m, of a law that keeps the limits.
    pub fn rms_error_m(&self) -> Option<f64> {
        self.found.as_ref().ok()?.report.as_ref()?.rms_error_m
    }
}

/// The study whose laws and limits are taken.
const STUDY: &str = "best";
/// The candidates that the search keeps for each key: one point may take longer than one of
/// thousands.
const POPULATION: usize = 16;

/// Searches the best gains of every law of the built-in study `best`.
///
/// # Errors
///
/// If the scenario is not acceptable, or it was interrupted.
pub fn advise(
    question: &Question,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Advice, StudyError> {
    let plan = plan(question)?;
    let limits = plan.best.as_ref().map(|best| best.limits.clone());
    let next = AtomicUsize::new(0);
    let found = Mutex::new(Vec::new());
    let work = || {
        while let point = next.fetch_add(1, Ordering::Relaxed)
            && point < plan.len()
            && let Some(best) = &plan.best
        {
            search::measure(&plan, best, &[point], proceed, &mut |point, result| {
                found.lock().unwrap_or_else(PoisonError::into_inner).push((point, result));
            });
        }
    };
    let threads = thread::available_parallelism().map_or(1, NonZero::get);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(work);
        }
    });
    let mut found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    let Some(limits) = limits.filter(|_| found.len() == plan.len()) else {
        return Err(StudyError::Stopped("all laws were tried"));
    };
    found.sort_by_key(|(point, _)| *point);
    let advised = found.into_iter().map(|(point, found)| {
        let law = plan.positions(point).first().map(|at| at.label.clone());
        Advised { law: law.unwrap_or_default(), found }
    });
    let (mut laws, others): (Vec<_>, Vec<_>) =
        advised.partition(|advised: &Advised| advised.rms_error_m().is_some());
    let error = |advised: &Advised| advised.rms_error_m().unwrap_or(f64::INFINITY);
    laws.sort_by(|a, b| error(a).total_cmp(&error(b)));
    Ok(Advice { limits, laws, others })
}

/// The study with one point for each law.
fn plan(question: &Question) -> Result<Plan, StudyError> {
    let text = builtin::built_in(STUDY).unwrap_or_default();
    let not_toml = |source| StudyError::NotToml { name: STUDY.to_owned(), source };
    let mut table: Table = text.parse().map_err(not_toml)?;
    table.remove("axes");
    table.insert("scenario".to_owned(), question.scenario.clone().into());
    let mut plan = Plan::parse(STUDY, &table.to_string(), &question.set)?;
    if let Some(best) = &mut plan.best {
        best.limits.torque_nm = question.torque_limit_nm.clone();
        best.limits.torque_step_nm =
            question.torque_step_limit_nm.unwrap_or(best.limits.torque_step_nm);
        best.cases = question.cases.clone();
        best.population = POPULATION;
    }
    Ok(plan)
}
