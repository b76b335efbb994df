//! What becomes of a run's results.

use std::{
    fs::File,
    io::{self, BufWriter, Write},
    path::PathBuf,
};

use clap::Args;
use mtj_model::scenario::Scenario;
use mtj_plant::{plant::Outcome, report::Report, trace};

use crate::failure::Failure;

/// What to do with a run's results
#[derive(Args, Clone, Debug, Default)]
pub struct OutputOptions {
    /// Print the measures as one JSON object
    #[arg(long)]
    pub json: bool,
    /// Write every sampling instant to a CSV file
    #[arg(long, value_name = "FILE.csv")]
    pub trace: Option<PathBuf>,
}

impl OutputOptions {
    /// Creates the trace's file, so that a path that cannot be written is known before the run.
    pub fn create_trace(&self) -> Result<Option<File>, Failure> {
        let Some(path) = &self.trace else { return Ok(None) };
        File::create(path).map(Some).map_err(|error| {
            Failure::bad_input(format!(
                "--trace {}: {error}; choose a file that can be written",
                path.display()
            ))
        })
    }

    /// Writes the trace, and the measures to standard output.
    pub fn finish(
        &self,
        scenario: &Scenario,
        outcome: &Outcome,
        trace: Option<File>,
    ) -> Result<(), Failure> {
        self.print(&outcome.report)?;
        let (Some(file), Some(path)) = (trace, &self.trace) else { return Ok(()) };
        let mut out = BufWriter::new(file);
        trace::write_csv(&mut out, scenario, &outcome.trace).and_then(|()| out.flush()).map_err(
            |error| {
                Failure::other(format!(
                    "--trace {}: {error}; the run's measures are complete",
                    path.display()
                ))
            },
        )
    }

    /// Writes the measures to standard output.
    pub fn print(&self, report: &Report) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        let mut print = || -> io::Result<()> {
            if self.json {
                serde_json::to_writer(&mut out, report)?;
                writeln!(out)
            } else {
                write!(out, "{report}")
            }
        };
        print()
            .map_err(|error| Failure::other(format!("the results could not be written: {error}")))
    }
}
