//! `mtj paper`: the paper's figures and numbers, beside what it prints.

use std::{
    fs,
    io::{self, Write},
    path::PathBuf,
};

use clap::Args;
use mtj_plant::report::Report;
use mtj_protocol::shutdown::Shutdown;
use serde::Serialize;

use crate::failure::Failure;
use crate::{
    figure::{FigureError, Written},
    paper::{
        comparison::{Comparison, ComparisonTable},
        figures,
        operations::{Counts, FINDINGS, Table1, count_all},
        runs::{Runs, RunsError},
        table::{NOT_REPRODUCIBLE, compare},
    },
};

/// Reproduce the paper's figures and tables, side by side with the printed values
#[derive(Args, Debug)]
pub struct Paper {
    /// Folder for the figures, made if need be
    #[arg(long, value_name = "DIR", default_value = "paper-out")]
    out: PathBuf,
    /// Print everything as one JSON object
    #[arg(long)]
    json: bool,
}

/// Everything that is printed.
#[derive(Serialize)]
struct Results<'a> {
    figures: Vec<Written>,
    runs: Vec<&'a Report>,
    table1: Vec<Counts>,
    table1_findings: &'static [&'static str],
    comparison: Vec<Comparison>,
    not_reproducible: &'static [&'static str],
}

impl Paper {
    /// Runs the twelve simulations, writes the figures and prints the comparison.
    pub fn run(self) -> Result<(), Failure> {
        self.create_folder()?;
        let shutdown = Shutdown::on_signals();
        let runs = Runs::make(&move || shutdown.proceed())?;
        let figures = figures::all(&runs)?
            .iter()
            .map(|(name, figure)| figure.write(&self.out, name))
            .collect::<Result<_, _>>()?;
        let table1 = count_all();
        let results = Results {
            figures,
            runs: runs.in_order().map(|outcome| &outcome.report).collect(),
            comparison: compare(&runs, &table1)?,
            table1,
            table1_findings: &FINDINGS,
            not_reproducible: &NOT_REPRODUCIBLE,
        };
        let mut out = io::stdout().lock();
        if self.json {
            serde_json::to_writer(&mut out, &results).map_err(io::Error::from)?;
            writeln!(out)?;
        } else {
            results.print(&mut out)?;
        }
        Ok(())
    }

    fn create_folder(&self) -> Result<(), Failure> {
        fs::create_dir_all(&self.out).map_err(|error| {
            let sentence = format!(
                "--out {}: {error}; choose a folder that can be written",
                self.out.display()
            );
            Failure { sentence, code: 2 }
        })
    }
}

impl Results<'_> {
    fn print(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "Figures")?;
        for Written { svg, png, .. } in &self.figures {
            writeln!(out, "  {}  {}", svg.display(), png.display())?;
        }
        writeln!(out, "\nTable 1: operations of one step, counted by running the laws\n")?;
        writeln!(out, "{}", Table1(&self.table1))?;
        list(out, self.table1_findings)?;
        writeln!(out, "\nWhat cannot be reproduced, or had to be chosen\n")?;
        list(out, self.not_reproducible)?;
        writeln!(out, "\nPrinted and ours\n")?;
        write!(out, "{}", ComparisonTable(&self.comparison))
    }
}

/// Sentences as a list, wrapped for a terminal.
fn list(out: &mut impl Write, sentences: &[&str]) -> io::Result<()> {
    const WIDTH: usize = 92;
    for sentence in sentences {
        let mut line = "  -".to_owned();
        for word in sentence.split_whitespace() {
            if line.chars().count() + 1 + word.chars().count() > WIDTH {
                writeln!(out, "{line}")?;
                line = "   ".to_owned();
            }
            line = line + " " + word;
        }
        writeln!(out, "{line}")?;
    }
    Ok(())
}

impl From<RunsError> for Failure {
    fn from(error: RunsError) -> Self {
        match error {
            RunsError::Scenario(error) => error.into(),
            RunsError::Plant(error) => error.into(),
            RunsError::Incomplete(_) => Self::new(error, false),
        }
    }
}

impl From<FigureError> for Failure {
    fn from(error: FigureError) -> Self {
        let is_bad_input = matches!(error, FigureError::File(..));
        Self::new(error, is_bad_input)
    }
}
