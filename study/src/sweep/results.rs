//! Results on disk: rows are appended as they come, so that an interruption loses none.

use std::{
    collections::BTreeMap,
    fs::{self, File, OpenOptions},
    io::{self, Write},
    path::{Path, PathBuf},
};

use mtj_plant::report::Report;

use super::plan::{self, Plan};
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
        let Some(reason) = row.error() else { return };
        self.count += 1;
        if self.first.as_ref().is_none_or(|(point, _)| row.point < *point) {
            self.first = Some((row.point, reason.to_owned()));
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
    done: BTreeMap<usize, ResultRow>,
    failures: Failures,
    columns: Vec<String>,
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
        let columns = columns(plan);
        let mut done = BTreeMap::new();
        let text = match fs::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(at(&path)(error)),
        };
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
        let rows = read_rows(&path, &text[..whole], &columns)?;
        let count = rows.len();
        done.extend(
            rows.into_iter().filter(|row| row.error().is_none()).map(|row| (row.point, row)),
        );
        let whole = if done.len() < count {
            write_sorted(&path, &columns, done.values())?;
            fs::metadata(&path).map_err(at(&path))?.len()
        } else {
            whole as u64
        };
        let file = OpenOptions::new().create(true).append(true).open(&path).map_err(at(&path))?;
        file.set_len(whole).map_err(at(&path))?;
        let mut results = Self { path, file, done, failures: Failures::default(), columns };
        if whole == 0 {
            let header = results.columns.clone();
            results.append(&header).map_err(at(&results.path))?;
        }
        Ok(results)
    }

    /// Whether a point has its row.
    pub fn has(&self, point: usize) -> bool {
        self.done.contains_key(&point)
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.done.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.done.is_empty()
    }

    /// The points that have failed since the folder was opened.
    pub fn failures(&self) -> &Failures {
        &self.failures
    }

    /// Appends a row, in one write, so that an interruption leaves at most one row cut short.
    pub fn push(&mut self, row: ResultRow) -> Result<(), StudyError> {
        self.append(&row.fields)
            .map_err(|source| StudyError::Append { path: self.path.clone(), source })?;
        self.failures.count_row(&row);
        self.done.insert(row.point, row);
        Ok(())
    }

    /// Puts the rows in order, once all are there.
    pub fn sort(self) -> Result<(), StudyError> {
        write_sorted(&self.path, &self.columns, self.done.values())
    }

    fn append(&mut self, fields: &[String]) -> io::Result<()> {
        self.file.write_all(&line(fields)?)
    }
}

/// A file that could not be read or written.
fn at(path: &Path) -> impl FnOnce(io::Error) -> StudyError + use<> {
    let path = path.to_owned();
    |source| StudyError::File { path, source }
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

/// The joined results of shards.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// How many points have a row.
    pub count: usize,
    /// Those of them that failed in every shard that has them.
    pub failures: Failures,
    /// The numbers of the points that no shard has.
    pub missing: Vec<usize>,
}

/// Joins the results of shards, in one folder or several, into one file in the first. A point that
/// failed in one and was run in another counts as run.
pub fn merge(folders: &[PathBuf], plan: &Plan) -> Result<Merged, StudyError> {
    let columns = columns(plan);
    let mut rows = BTreeMap::<usize, ResultRow>::new();
    for folder in folders {
        claim(folder, plan)?;
        let entries = fs::read_dir(folder).map_err(at(folder))?;
        for path in entries.flatten().map(|entry| entry.path()) {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if name.starts_with("results") && name.ends_with(".csv") {
                let text = fs::read(&path).map_err(at(&path))?;
                let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
                for row in read_rows(&path, &text[..whole], &columns)? {
                    match rows.get(&row.point) {
                        Some(_) if row.error().is_some() => {}
                        Some(other) if other.error().is_none() && *other != row => {
                            return Err(StudyError::TwoResults { point: row.point, path });
                        }
                        _ => {
                            rows.insert(row.point, row);
                        }
                    }
                }
            }
        }
    }
    let missing = (0..plan.len()).filter(|point| !rows.contains_key(point)).collect();
    let mut merged = Merged { count: rows.len(), missing, ..Merged::default() };
    rows.values().for_each(|row| merged.failures.count_row(row));
    if let Some(first) = folders.first() {
        write_sorted(&first.join(Shard::ALL.file_name()), &columns, rows.values())?;
    }
    Ok(merged)
}

/// The rows of a folder's merged results, in order.
pub fn read(folder: &Path, plan: &Plan) -> Result<Vec<ResultRow>, StudyError> {
    let path = folder.join(Shard::ALL.file_name());
    let text = fs::read(&path).map_err(at(&path))?;
    let mut rows = read_rows(&path, &text, &columns(plan))?;
    rows.sort_by_key(|row| row.point);
    Ok(rows)
}

fn read_rows(path: &Path, text: &[u8], columns: &[String]) -> Result<Vec<ResultRow>, StudyError> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text);
    let mut rows = Vec::new();
    for (number, record) in reader.records().enumerate() {
        let fields: Vec<String> = record
            .map_err(|source| StudyError::Csv { path: path.to_owned(), source })?
            .iter()
            .map(str::to_owned)
            .collect();
        if number == 0 && fields == columns {
            continue;
        }
        let point = fields.first().and_then(|field| field.parse().ok());
        match point {
            Some(point) if number > 0 && fields.len() == columns.len() => {
                rows.push(ResultRow { point, fields });
            }
            _ => {
                return Err(StudyError::NotARow { path: path.to_owned(), line: number + 1 });
            }
        }
    }
    Ok(rows)
}

fn write_sorted<'a>(
    path: &Path,
    columns: &[String],
    rows: impl Iterator<Item = &'a ResultRow>,
) -> Result<(), StudyError> {
    let new = path.with_extension(format!("{}.new", std::process::id()));
    let write = || -> io::Result<()> {
        let mut text = line(columns)?;
        for row in rows {
            text.extend(line(&row.fields)?);
        }
        fs::write(&new, text)?;
        fs::rename(&new, path)
    };
    write().map_err(at(path))
}

fn line(fields: &[String]) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(fields)?;
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}
