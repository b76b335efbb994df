//! Loads that the tip of an arm takes up and drops.

use std::time::Duration;

use super::{
    error::ScenarioError,
    key::{Default::Required, Form, Parameter, Range},
    section::Section,
};

const AT: Parameter = Parameter::new(
    "load[].at",
    Form::Duration(Duration::ZERO),
    "",
    Required,
    "When the tip takes it up; later than the entry before.",
);
const MASS: Parameter = Parameter::new(
    "load[].mass",
    Form::Number(Range::NotNegative),
    "kg",
    Required,
    "What the tip carries from then on; 0 drops it. It moves as the tip does when it is taken up.",
);
/// The keys of an entry of `load`.
pub(super) const KEYS: &[&Parameter] = &[&AT, &MASS];

/// What the tip carries from an instant on. The controller's model does not know it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Since the run began.
    pub at: Duration,
    /// A point at the tip, kg.
    pub mass: f64,
}

/// The loads of a scenario, in the order of time.
pub(super) fn read(root: &Section<'_>) -> Result<Vec<Load>, ScenarioError> {
    let expected = "a list of loads, each {at, mass}";
    let mut loads: Vec<Load> = Vec::new();
    for entry in root.optional_sections("load", expected)? {
        let load = Load { at: entry.duration(&AT)?, mass: entry.number(&MASS)? };
        if loads.last().is_some_and(|before| before.at >= load.at) {
            return Err(entry.refuse(AT.name(), "an instant after that of the entry before"));
        }
        entry.finish()?;
        loads.push(load);
    }
    Ok(loads)
}
