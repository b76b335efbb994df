//! `mtj study predict`: how much latency the loop should stand, beside how much it does.

use std::{
    io::{self, Write},
    num::NonZero,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use clap::Args;
use mtj_protocol::shutdown::Shutdown;
use mtj_study::{
    StudyError,
    predict::{self, MOST, Prediction},
};

use crate::{failure::Failure, options::study::StudyOptions};

/// Predict the largest latency of each loop of a study, and measure it
#[derive(Args, Debug)]
pub struct Predict {
    #[command(flatten)]
    study: StudyOptions,
    /// Only predict: the measurement takes a minute
    #[arg(long)]
    no_measurement: bool,
    /// Print CSV
    #[arg(long)]
    csv: bool,
}

struct Line {
    labels: Vec<String>,
    prediction: Prediction,
    measured: Option<Option<f64>>,
}

/// How far prediction and measurement may be apart for the loop to count as linear. If it stands
/// more than predicted, the worst mass on the path is met for too short a time. If it stands less,
/// J and Ĥ change between the sample and the application.
const LINEAR: f64 = 0.15;

impl Predict {
    /// Prints a line for each combination of positions on the study's other axes.
    pub fn run(self) -> Result<(), Failure> {
        let plan = self.study.load()?;
        let scenarios = predict::scenarios(&plan)?;
        let shutdown = Shutdown::on_signals();
        let proceed = move || shutdown.proceed();
        let next = AtomicUsize::new(0);
        let lines = Mutex::new(Vec::new());
        let threads = thread::available_parallelism().map_or(1, NonZero::get);
        thread::scope(|scope| {
            let work = || -> Result<(), StudyError> {
                while let Some((labels, scenario)) =
                    scenarios.get(next.fetch_add(1, Ordering::Relaxed))
                    && proceed()
                {
                    let prediction = predict::predict(scenario, &proceed)?;
                    let measured = match self.no_measurement {
                        true => None,
                        false => Some(predict::measure(scenario, prediction.latency, &proceed)?),
                    };
                    let line = Line { labels: labels.clone(), prediction, measured };
                    lines.lock().unwrap_or_else(PoisonError::into_inner).push(line);
                }
                Ok(())
            };
            let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
            workers
                .into_iter()
                .try_for_each(|worker| worker.join().unwrap_or(Err(StudyError::Panicked)))
        })?;
        let mut lines = lines.into_inner().unwrap_or_else(PoisonError::into_inner);
        let order = |line: &Line| scenarios.iter().position(|(labels, _)| *labels == line.labels);
        lines.sort_by_key(order);
        let names: Vec<_> =
            plan.axes
                .iter()
                .filter(|axis| {
                    !axis.positions.iter().all(|p| {
                        p.set.iter().all(|set| predict::LATENCY_KEYS.contains(&set.path()))
                    })
                })
                .map(|axis| axis.name.as_str())
                .collect();
        if self.csv {
            print_csv(&names, &lines)?;
        } else {
            print_table(&names, &lines)?;
        }
        Ok(())
    }
}

fn print_csv(names: &[&str], lines: &[Line]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "{},k,least_mass_kg,most_mass_kg,predicted_latency_s,measured_latency_s",
        names.join(",")
    )?;
    for Line { labels, prediction, measured } in lines {
        let number = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
        writeln!(
            out,
            "{},{},{},{},{},{}",
            labels.join(","),
            number(prediction.factor),
            prediction.masses.least,
            prediction.masses.most,
            number(prediction.latency),
            number(measured.flatten())
        )?;
    }
    Ok(())
}

fn print_table(names: &[&str], lines: &[Line]) -> io::Result<()> {
    let mut out = io::stdout().lock();
    let labels: Vec<String> = lines.iter().map(|line| line.labels.join("  ")).collect();
    let width = labels.iter().map(|label| label.chars().count()).max().unwrap_or(0).max(30);
    writeln!(
        out,
        "{:<width$}  {:>5}  {:>11}  {:>10}  {:>10}  ",
        names.join("  "),
        "k",
        "mass kg",
        "predicted",
        "measured"
    )?;
    let milliseconds = |x: Option<f64>| match x {
        None => "unstable".to_owned(),
        Some(x) if x >= MOST => format!("> {:.0} ms", MOST * 1e3),
        Some(x) => format!("{:.3} ms", x * 1e3),
    };
    let mut far = 0;
    for (label, Line { prediction, measured, .. }) in labels.iter().zip(lines) {
        let Prediction { factor, masses, latency } = prediction;
        let k = factor.map_or("-".to_owned(), |k| format!("{k:.2}"));
        let mass = format!("{:.2}-{:.2}", masses.least, masses.most);
        let measured_text = measured.map_or(String::new(), milliseconds);
        let remark = match (latency, measured) {
            (Some(predicted), Some(Some(measured)))
                if (predicted / measured - 1.0).abs() > LINEAR =>
            {
                far += 1;
                if predicted < measured {
                    "only the worst mass fails"
                } else {
                    "the arm moves far meanwhile"
                }
            }
            _ => "",
        };
        writeln!(
            out,
            "{label:<width$}  {k:>5}  {mass:>11}  {:>10}  {measured_text:>10}  {remark}",
            milliseconds(*latency)
        )?;
    }
    let compared = lines
        .iter()
        .filter(|line| line.prediction.latency.is_some() && line.measured.flatten().is_some())
        .count();
    if compared > 0 {
        writeln!(
            out,
            "{} of {compared} predictions within {:.0} % of the measurement",
            compared - far,
            LINEAR * 100.0
        )?;
    }
    Ok(())
}
