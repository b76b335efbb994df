//! Results on disk: rows are appended as they come, so that an interruption loses none.

use std::{
    fs::{self, File, OpenOptions},
    io::Write,
    iter::StepBy,
    ops::Range,
    path::{Path, PathBuf},
};

use mtj_plant::report::Report;

use super::{
    plan::{self, Plan},
    points::PointSet,
    rows::{Merged, Rows, Sorter, at, line},
};
use crate::error::StudyError;

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
    let measures = MEASURES.iter().map(|name| (*name).to_owned());
    std::iter::once("point".to_owned()).chain(axes).chain(measures).collect()
}

/// A point's row. Nothing in it depends on wall time, so that it is the same on any bus, machine
/// and number of threads.
pub fn row(plan: &Plan, point: usize, measured: &Measured) -> ResultRow {
    let number = |x: Option<f64>| x.map(|x| x.to_string()).unwrap_or_default();
    let positions = plan.positions(point).into_iter().map(|position| position.label.clone());
    let measures: [String; MEASURES.len()] = match measured {
        Ok(report) => {
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
        Err(error) => {
            let mut fields = <[String; MEASURES.len()]>::default();
            fields[MEASURES.len() - 1] = error.to_string().replace('\n', " ");
            fields
        }
    };
    let fields = std::iter::once(point.to_string()).chain(positions).chain(measures).collect();
    ResultRow { point, fields }
}

/// The part of the points that one process computes: every `of`-th, from the `index`-th on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1.
    pub index: usize,
    /// How many shards there are.
    pub of: usize,
}

/// A text that names no shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected i/n with i from 1 to n, like 2/8")]
pub struct ShardError;

impl std::str::FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parts = text
            .split_once('/')
            .and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parts {
            Some((index, of)) if (1..=of).contains(&index) => Ok(Self { index, of }),
            _ => Err(ShardError),
        }
    }
}

impl Shard {
    /// All points.
    pub const ALL: Self = Self { index: 1, of: 1 };

    /// Whether a point belongs to this shard.
    pub fn has(&self, point: usize) -> bool {
        point % self.of == self.index - 1
    }

    /// Its points, of so many.
    pub fn points(self, all: usize) -> StepBy<Range<usize>> {
        (self.index - 1..all).step_by(self.of)
    }

    fn file_name(&self) -> String {
        if self.of == 1 {
            "results.csv".to_owned()
        } else {
            format!("results-{}-of-{}.csv", self.index, self.of)
        }
    }
}

/// A study's folder: the study itself and the rows so far.
#[derive(Debug)]
pub struct Results {
    path: PathBuf,
    file: File,
    done: PointSet,
    failures: Failures,
}

impl Results {
    /// Opens a folder for a study, creating it if need be, and takes up the rows that are there. A
    /// row that an interruption has cut short is removed, and so is one of a point that failed:
    /// both are computed again.
    pub fn open(folder: &Path, plan: &Plan, shard: Shard) -> Result<Self, StudyError> {
        fs::create_dir_all(folder)
            .map_err(|source| StudyError::Folder { folder: folder.to_owned(), source })?;
        claim(folder, plan)?;
        let path = folder.join(shard.file_name());
        let mut file =
            OpenOptions::new().create(true).append(true).open(&path).map_err(at(&path))?;
        let mut rows = Rows::open(&path, plan)?;
        file.set_len(rows.length()).map_err(at(&path))?;
        if rows.length() == 0 {
            file.write_all(&line(&columns(plan)).map_err(at(&path))?).map_err(at(&path))?;
        }
        let (mut done, mut has_failed) = (PointSet::none_of(plan.len()), false);
        while let Some(row) = rows.next() {
            let row = row?;
            if !shard.has(row.point) {
                return Err(rows.refuse());
            }
            match row.error() {
                Some(_) => has_failed = true,
                None => done.insert(row.point),
            }
        }
        if has_failed {
            let mut sorter = Sorter::new(&path)?;
            for row in Rows::open(&path, plan)? {
                let row = row?;
                if row.error().is_none() {
                    sorter.insert(&row, &path)?;
                }
            }
            sorter.finish(plan)?;
            file = OpenOptions::new().append(true).open(&path).map_err(at(&path))?;
        }
        Ok(Self { path, file, done, failures: Failures::default() })
    }

    /// The points that have their row.
    pub(crate) fn done(&self) -> &PointSet {
        &self.done
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.done.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The points that have failed since the folder was opened.
    pub fn failures(&self) -> &Failures {
        &self.failures
    }

    /// Appends a row, in one write, so that an interruption leaves at most one row cut short.
    pub fn push(&mut self, row: &ResultRow) -> Result<(), StudyError> {
        line(&row.fields)
            .and_then(|text| self.file.write_all(&text))
            .map_err(|source| StudyError::Append { path: self.path.clone(), source })?;
        self.failures.count_row(row);
        self.done.insert(row.point);
        Ok(())
    }

    /// Puts the rows in order, once all are there.
    pub fn sort(self, plan: &Plan) -> Result<(), StudyError> {
        let mut sorter = Sorter::new(&self.path)?;
        for row in Rows::open(&self.path, plan)? {
            sorter.insert(&row?, &self.path)?;
        }
        sorter.finish(plan).map(|_| ())
    }
}

/// Notes in the folder which study it holds, or checks that it is this one.
fn claim(folder: &Path, plan: &Plan) -> Result<(), StudyError> {
    let path = folder.join(plan::FILE);
    match fs::read_to_string(&path) {
        Ok(text) if plan.is_in(&text) => Ok(()),
        Ok(_) => Err(StudyError::OtherStudy { folder: folder.to_owned() }),
        Err(_) => {
            let new = folder.join(format!("{}.{}", plan::FILE, std::process::id()));
            fs::write(&new, plan.file()).and_then(|()| fs::rename(&new, &path)).map_err(at(&path))
        }
    }
}

/// Joins the results of shards, in one folder or several, into one file in the first. A point that
/// failed in one and was run in another counts as run.
pub fn merge(folders: &[PathBuf], plan: &Plan) -> Result<Merged, StudyError> {
    let Some(first) = folders.first() else {
        return Ok(Merged { missing: plan.len(), ..Merged::default() });
    };
    let mut sorter = Sorter::new(&first.join(Shard::ALL.file_name()))?;
    for folder in folders {
        claim(folder, plan)?;
        let entries = fs::read_dir(folder).map_err(at(folder))?;
        for path in entries.flatten().map(|entry| entry.path()) {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if name.starts_with("results") && name.ends_with(".csv") {
                for row in Rows::open(&path, plan)? {
                    sorter.insert(&row?, &path)?;
                }
            }
        }
    }
    sorter.finish(plan)
}

/// The rows of a folder's merged results, one after the other: in the order of points once the
/// study is complete, before that as they came.
pub fn read(folder: &Path, plan: &Plan) -> Result<Rows, StudyError> {
    Rows::open(&folder.join(Shard::ALL.file_name()), plan)
}
