//! Which experiment a command is about.

use clap::Args;
use mtj_model::scenario::{Override, Scenario, ScenarioError};
use mtj_options::BusOptions;

/// Which experiment
#[derive(Args, Clone, Debug)]
pub struct ScenarioOptions {
    /// Built-in scenario ('mtj scenario list' prints them) or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "sampled/mtj")]
    pub scenario: String,
    /// Set any key of the scenario, like law.memory.policy=delivered; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Where the other roles are.
    #[command(flatten)]
    pub bus: BusOptions,
}

impl ScenarioOptions {
    /// Loads the scenario with everything set that was asked for.
    pub fn load(&self) -> Result<Scenario, ScenarioError> {
        let mut overrides: Vec<Override> =
            self.set.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        overrides.extend(self.bus.overrides());
        Scenario::load(&self.scenario, &overrides)
    }

    /// Loads the scenario, and tells the user what to expect of it.
    pub fn load_with_advice(&self) -> Result<Scenario, ScenarioError> {
        let scenario = self.load()?;
        for advice in scenario.advice() {
            tracing::warn!("{}: {advice}", scenario.name);
        }
        Ok(scenario)
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let mut arguments = vec!["--scenario".to_owned(), self.scenario.clone()];
        for set in &self.set {
            arguments.extend(["--set".to_owned(), set.clone()]);
        }
        arguments.extend(self.bus.arguments());
        arguments
    }
}
