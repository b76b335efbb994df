//! Results on disk: rows are appended as they come, so that an interruption loses none.

use std::{
    fs::{self, File, OpenOptions},
    io::Write,
    iter::StepBy,
    ops::Range,
    path::{Path, PathBuf},
};

pub(crate) use super::row::row_with;
pub use super::row::{Failures, MEASURES, Measured, ResultRow, columns, row};
use super::{
    plan::{self, Plan},
    points::PointSet,
    rows::{Merged, Rows, Sorter, at, line},
};
use crate::error::StudyError;

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
