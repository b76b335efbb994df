//! The best gains of each law at each point: what a fair comparison of laws takes.
//!
//! A study with a table `best` has the laws as its first axis, and at each point searches the gains
//! that make the rms error least within limits of torque, torque step and margin. The search is
//! differential evolution (`population.rs`) over short runs, then over full ones; every run is in
//! lanes, those of all candidates of some points side by side. The best is run again on the scalar
//! path, so that `mtj run` repeats its error to the last digit.
//!
//! ```text
//! settings (table `best`) ─▶ search ─▶ verdict ─▶ row ─▶ report
//!                              ▲ population
//! ```

pub mod advice;
mod population;
mod row;
mod search;
pub(crate) mod settings;
mod verdict;

use mtj_model::scenario::Override;
use mtj_plant::report::Report;

pub(crate) use row::row;
pub(crate) use search::measure;
pub use settings::{Best, Entry, GainRange, Limits};
pub use verdict::{Binding, Limit};

/// The best gains of a law at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The keys that were searched, with their values; none if no gains keep all limits.
    pub gains: Vec<Override>,
    /// The measures of the run with the largest error; `None` if no gains keep all limits.
    pub report: Option<Report>,
    /// The largest rms error with the margin, m.
    pub margin_rms_error_m: Option<f64>,
    /// What stands in the way of a lower error, or of any gains.
    pub limit: Binding,
    /// The command that repeats the run.
    pub command: String,
}

impl Default for Found {
    /// Nothing found.
    fn default() -> Self {
        Self {
            gains: Vec::new(),
            report: None,
            margin_rms_error_m: None,
            limit: Binding::Nothing,
            command: String::new(),
        }
    }
}
