//! The study that a command is about.

use clap::Args;
use mtj_model::scenario::Override;
use mtj_study::sweep::plan::Plan;

use crate::failure::Failure;

/// The study of a command
#[derive(Args, Debug)]
pub struct StudyOptions {
    /// Built-in study ('mtj study list' prints them) or TOML file
    study: String,
    /// Set any key at every point; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
}

impl StudyOptions {
    /// Loads the study with everything that `--set` sets.
    pub fn load(&self) -> Result<Plan, Failure> {
        let set: Vec<Override> =
            self.set.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        Ok(Plan::load(&self.study, &set)?)
    }
}
