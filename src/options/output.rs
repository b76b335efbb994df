//! What becomes of a run's results.

use std::{
    fs::{File, OpenOptions},
    io::{self, Write},
    path::PathBuf,
};

use clap::Args;
use mtj_plant::{report::Report, trace::TraceWriter};

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
    /// Opens the trace's file, so that a path that cannot be written is known before the run. What
    /// the file has stays until the run begins.
    pub fn open_trace(&self) -> Result<Option<File>, Failure> {
        let Some(path) = &self.trace else { return Ok(None) };
        let opened = OpenOptions::new().write(true).create(true).truncate(false).open(path);
        opened.map(Some).map_err(|error| {
            Failure::bad_input(format!(
                "--trace {}: {error}; choose a file that can be written",
                path.display()
            ))
        })
    }

    /// Writes the measures to standard output, and what is left of the trace to its file. No stream
    /// to it may be left.
    pub fn finish(&self, report: &Report, trace: Option<TraceWriter>) -> Result<(), Failure> {
        self.print(report)?;
        let (Some(writer), Some(path)) = (trace, &self.trace) else { return Ok(()) };
        match writer.finish() {
            Ok(0) => Ok(()),
            Ok(dropped) => {
                tracing::warn!(
                    "--trace {}: {dropped} rows are missing: the disk did not keep up",
                    path.display()
                );
                Ok(())
            }
            Err(error) => Err(Failure::other(format!(
                "--trace {}: {error}; the run's measures are complete",
                path.display()
            ))),
        }
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
