//! `mtj study`: sweeps.

use std::{
    io::{self, Write},
    num::NonZero,
    path::{Path, PathBuf},
    thread,
};

use clap::{Args, Subcommand};
use mtj_model::scenario::{BusKind, Override, Scenario};
use mtj_options::BusOptions;
use mtj_protocol::shutdown::Shutdown;
use mtj_study::sweep::{
    builtin::BUILT_IN,
    plan::Plan,
    results::{self, Failures, Results, Shard},
    rows::Merged,
    runner,
};

use super::{predict::Predict, report::ReportStudy};
use crate::{
    failure::Failure,
    options::{realtime::LoopRealtime, scenario::ScenarioOptions, study::StudyOptions},
    session::Session,
};

/// Sweep a scenario over any of its keys
#[derive(Args, Debug)]
pub struct StudyCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Print the names of the built-in studies
    List,
    /// Print a study as TOML
    Show(StudyOptions),
    /// Compute a study's points; run again to go on after an interruption
    Run(Box<RunStudy>),
    /// Join the results of shards and say what is missing
    Merge(Merge),
    Predict(Predict),
    Report(ReportStudy),
}

#[derive(Args, Debug)]
struct RunStudy {
    #[command(flatten)]
    study: StudyOptions,
    /// Folder for the results
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do every n-th point, beginning with the i-th
    #[arg(long, value_name = "i/n", default_value = "1/1")]
    shard: Shard,
    /// Threads; as many as there are cores unless given
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    #[command(flatten)]
    bus: BusOptions,
}

#[derive(Args, Debug)]
struct Merge {
    #[command(flatten)]
    study: StudyOptions,
    /// Folders that hold shards; the first receives the joined results
    #[arg(required = true)]
    folders: Vec<PathBuf>,
}

impl StudyCommand {
    /// Does what the subcommand says.
    pub fn run(self) -> Result<(), Failure> {
        match self.action {
            Action::List => {
                let mut out = io::stdout().lock();
                for (name, text) in BUILT_IN {
                    let plan = Plan::parse(name, text, &[])?;
                    writeln!(out, "{name:<15} {:>6} points  {}", plan.len(), plan.title)?;
                }
                Ok(())
            }
            Action::Show(study) => {
                io::stdout().write_all(study.load()?.shown().as_bytes())?;
                Ok(())
            }
            Action::Run(run) => run.run(),
            Action::Merge(merge) => merge.run(),
            Action::Predict(predict) => predict.run(),
            Action::Report(report) => report.run(),
        }
    }
}

impl RunStudy {
    fn run(self) -> Result<(), Failure> {
        let plan = self.study.load()?;
        if plan.best.is_some() && !self.bus.overrides().is_empty() {
            return Err(Failure::bad_input(format!(
                "{}: the best gains are searched in this process; leave out --bus and what belongs to \
                 it",
                plan.name
            )));
        }
        let shutdown = Shutdown::on_signals();
        let proceed = move || shutdown.proceed();
        let mut results = Results::open(&self.out, &plan, self.shard)?;
        let cores = || thread::available_parallelism().map_or(1, NonZero::get);
        let threads = self.threads.map_or_else(cores, NonZero::get);
        let is_complete = match self.bus_scenario(&plan)? {
            None => runner::run_in_process(&plan, &mut results, self.shard, threads, &proceed)?,
            Some(options) => match Session::open(options, LoopRealtime::default(), &proceed)? {
                None => false,
                Some(mut session) => {
                    let mut run = |scenario: &_| session.run(scenario, &proceed);
                    runner::run_one_by_one(&plan, &mut results, self.shard, &mut run)?
                }
            },
        };
        let count = results.len();
        if is_complete {
            let failures = results.failures().clone();
            results.sort(&plan)?;
            conclude(count, &failures, &self.out)
        } else {
            Err(Failure::other(format!(
                "stopped after {count} of {} points{}; run the same command again to go on",
                plan.len(),
                failed(results.failures())
            )))
        }
    }

    /// The options of a session over a real bus, if one is asked for.
    fn bus_scenario(&self, plan: &Plan) -> Result<Option<ScenarioOptions>, Failure> {
        if self.bus.overrides().is_empty() {
            return Ok(None);
        }
        // Any point will do: what differs between points is not the bus.
        let options = ScenarioOptions {
            scenario: plan.scenario.clone(),
            set: plan.overrides(0).iter().map(Override::to_string).collect(),
            bus: self.bus.clone(),
        };
        let scenario: Scenario = options.load()?;
        Ok((scenario.bus.kind != BusKind::Local).then_some(options))
    }
}

impl Merge {
    fn run(self) -> Result<(), Failure> {
        let plan = self.study.load()?;
        let merged = results::merge(&self.folders, &plan)?;
        let Merged { count, failures, missing, first_missing } = merged;
        if let (0, Some(first)) = (missing, self.folders.first()) {
            return conclude(count, &failures, first);
        }
        let some: Vec<_> = first_missing.iter().map(usize::to_string).collect();
        let more = if missing > some.len() { ", ..." } else { "" };
        Err(Failure::other(format!(
            "{missing} of {} points are missing: {}{more}{}",
            plan.len(),
            some.join(", "),
            failed(&failures)
        )))
    }
}

/// Says how many points were run, and fails if some could not be.
fn conclude(count: usize, failures: &Failures, folder: &Path) -> Result<(), Failure> {
    let points = format!("{} points in {}", count - failures.count(), folder.display());
    if failures.count() == 0 {
        writeln!(io::stdout(), "{points}")?;
        return Ok(());
    }
    let remedy = "'mtj study run' tries them again";
    Err(Failure::other(format!("{points}{}; {remedy}", failed(failures))))
}

/// How many points failed and why, to follow a count; empty if none did.
fn failed(failures: &Failures) -> String {
    let reason = failures.reason().map(|reason| format!(", {} failed: {reason}", failures.count()));
    reason.unwrap_or_default()
}
