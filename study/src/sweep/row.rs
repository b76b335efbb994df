//! A row of results: a point's number, its positions and its measures.

use mtj_plant::report::Report;

use super::plan::Plan;
use crate::{best::settings::Best, error::StudyError};

/// The measures of a point, in the order of their columns.
pub const MEASURES: [&str; 12] = [
    "rms_error_m",
    "peak_error_m",
    "energy_j",
    "peak_torque_nm",
    "torque_step_rms_nm",
    "diverged",
    "samples",
    "sent",
    "applied",
    "lost",
    "rejected",
    "error",
];

/// The result of one point: its measures, or why it could not be run.
pub type Measured = Result<Report, StudyError>;

/// One row: the point's number, its positions, its measures, as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResultRow {
    /// Number of the point.
    pub point: usize,
    /// All columns, the first of which is the point's number.
    pub fields: Vec<String>,
}

impl ResultRow {
    /// Why the point could not be run; `None` if it was.
    pub fn error(&self) -> Option<&str> {
        self.fields.last().map(String::as_str).filter(|error| !error.is_empty())
    }
}

/// The points that could not be run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Failures {
    count: usize,
    first: Option<(usize, String)>,
}

impl Failures {
    /// How many points failed.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Why the point with the lowest number failed; `None` if none did.
    pub fn reason(&self) -> Option<&str> {
        self.first.as_ref().map(|(_, reason)| reason.as_str())
    }

    /// Counts the row of a point if it failed.
    pub(crate) fn count_row(&mut self, row: &ResultRow) {
        if let Some(reason) = row.error() {
            self.add(row.point, || reason.to_owned());
        }
    }

    /// Counts a point that failed.
    pub(crate) fn add(&mut self, point: usize, reason: impl FnOnce() -> String) {
        self.count += 1;
        if self.first.as_ref().is_none_or(|(first, _)| point < *first) {
            self.first = Some((point, reason()));
        }
    }
}

/// The header line of a study's results.
pub fn columns(plan: &Plan) -> Vec<String> {
    let axes = plan.axes.iter().map(|axis| match axis.unit {
        "" => axis.name.clone(),
        unit => format!("{}_{unit}", axis.name),
    });
    let mut columns: Vec<String> = std::iter::once("point".to_owned()).chain(axes).collect();
    columns.extend(MEASURES.iter().map(|name| (*name).to_owned()));
    // The error is the last.
    let of_best = plan.best.as_ref().map(Best::columns).unwrap_or_default();
    let last = columns.len() - 1;
    columns.splice(last..last, of_best);
    columns
}

/// A point's row. Nothing in it depends on wall time, so that it is the same on any bus, machine
/// and number of threads.
pub fn row(plan: &Plan, point: usize, measured: &Measured) -> ResultRow {
    row_with(plan, point, Some(measured), Vec::new())
}

/// A point's row with more columns before the error; no measures where none were taken.
pub(crate) fn row_with(
    plan: &Plan,
    point: usize,
    measured: Option<&Measured>,
    more: Vec<String>,
) -> ResultRow {
    let number = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
    let positions = plan.positions(point).into_iter().map(|position| position.label.clone());
    let measures: [String; MEASURES.len()] = match measured {
        None => Default::default(),
        Some(Ok(report)) => {
            let peak = report.peak_torque_nm.iter().copied().fold(0.0, f64::max);
            let commands = &report.commands;
            [
                number(report.rms_error_m),
                number(report.peak_error_m),
                number(report.energy_j),
                number(Some(peak).filter(|x| x.is_finite())),
                number(report.torque_step_rms_nm),
                report.diverged.to_string(),
                report.samples.to_string(),
                commands.sent.to_string(),
                commands.applied.to_string(),
                commands.lost.to_string(),
                commands.rejected.to_string(),
                String::new(),
            ]
        }
        Some(Err(error)) => {
            let mut fields = <[String; MEASURES.len()]>::default();
            fields[MEASURES.len() - 1] = error.to_string().replace('\n', " ");
            fields
        }
    };
    let mut fields: Vec<String> =
        std::iter::once(point.to_string()).chain(positions).chain(measures).collect();
    let last = fields.len() - 1;
    fields.splice(last..last, more);
    ResultRow { point, fields }
}
