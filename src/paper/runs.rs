//! The twelve simulations of section 4.

use std::{
    collections::BTreeMap,
    sync::atomic::{AtomicUsize, Ordering},
    thread,
};

use mtj_model::scenario::{Scenario, ScenarioError};
use mtj_plant::{error::PlantError, plant::Outcome};

use mtj_study::experiment;

/// The scenarios, `paper/` left out.
pub(crate) const NAMES: [&str; 12] = [
    "fig2-tj",
    "fig2-mtj",
    "fig3-tj",
    "fig3-mtj",
    "fig4-tj",
    "fig4-mtj",
    "fig4-mb",
    "fig4-mb-perturbed",
    "fig5-tj",
    "fig5-mtj",
    "fig5-mb",
    "fig5-mb-perturbed",
];

/// Why the runs were not completed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunsError {
    /// A scenario is not acceptable.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A run failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A run was stopped, or a figure needs one that was not made.
    #[error("the run paper/{0} was not completed")]
    Incomplete(String),
}

impl RunsError {
    /// Whether the cause is what the user gave.
    pub(crate) fn is_bad_input(&self) -> bool {
        match self {
            Self::Scenario(_) => true,
            Self::Plant(error) => error.is_bad_input(),
            Self::Incomplete(_) => false,
        }
    }
}

/// Outcomes by the names in [`NAMES`].
pub(crate) struct Runs(BTreeMap<&'static str, Outcome>);

impl Runs {
    /// Runs all of them, on all cores, until `proceed` returns false.
    pub(crate) fn make(proceed: &(dyn Fn() -> bool + Sync)) -> Result<Self, RunsError> {
        let next = AtomicUsize::new(0);
        let work = || {
            let mut done = Vec::new();
            while let Some(&name) = NAMES.get(next.fetch_add(1, Ordering::Relaxed)) {
                done.push((name, run(name, proceed)?));
            }
            Ok::<_, RunsError>(done)
        };
        let cores = thread::available_parallelism().map_or(1, usize::from).min(NAMES.len());
        let finished: Vec<_> = thread::scope(|scope| {
            let workers: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
            workers.into_iter().map(thread::ScopedJoinHandle::join).collect()
        });
        let mut outcomes = BTreeMap::new();
        for done in finished {
            outcomes.extend(done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
        }
        Ok(Self(outcomes))
    }

    /// The outcome of a run.
    pub(crate) fn get(&self, name: &str) -> Result<&Outcome, RunsError> {
        self.0.get(name).ok_or_else(|| RunsError::Incomplete(name.to_owned()))
    }

    /// All outcomes, in the order of [`NAMES`].
    pub(crate) fn in_order(&self) -> impl Iterator<Item = &Outcome> {
        NAMES.iter().filter_map(|name| self.0.get(name))
    }
}

/// The built-in scenario of a name.
pub(crate) fn scenario(name: &str) -> Result<Scenario, ScenarioError> {
    Scenario::load(&format!("paper/{name}"), &[])
}

fn run(name: &str, proceed: &dyn Fn() -> bool) -> Result<Outcome, RunsError> {
    let outcome =
        experiment::run_direct(&scenario(name)?, true, proceed).map_err(RunsError::Plant)?;
    if outcome.interrupted {
        return Err(RunsError::Incomplete(name.to_owned()));
    }
    Ok(outcome)
}
