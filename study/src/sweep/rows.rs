//! Rows on disk: read one after the other, and put in order without holding them in memory.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Take, Write},
    path::{Path, PathBuf},
};

use super::{
    plan::Plan,
    row::{Failures, ResultRow, columns},
};
use crate::error::StudyError;

/// A file that could not be read or written.
pub(crate) fn at(path: &Path) -> impl FnOnce(io::Error) -> StudyError + use<> {
    let path = path.to_owned();
    |source| StudyError::File { path, source }
}

/// The rows of a file of results, one after the other; a last row that was cut short is left out.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    reader: csv::Reader<Take<File>>,
    /// The length of the whole lines.
    length: u64,
    columns: Vec<String>,
    /// How many points the study has.
    points: usize,
    line: usize,
}

impl Rows {
    /// Opens a file of a study's results.
    pub(crate) fn open(path: &Path, plan: &Plan) -> Result<Self, StudyError> {
        let mut file = File::open(path).map_err(at(path))?;
        let length = whole_length(&mut file).map_err(at(path))?;
        Ok(Self {
            path: path.to_owned(),
            reader: csv::ReaderBuilder::new().has_headers(false).from_reader(file.take(length)),
            length,
            columns: columns(plan),
            points: plan.len(),
            line: 0,
        })
    }

    /// The length of the file without a row that was cut short.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// The line that was read last is no row of this study.
    pub(crate) fn refuse(&self) -> StudyError {
        StudyError::NotARow { path: self.path.clone(), line: self.line }
    }

    fn read(&mut self) -> Result<Option<ResultRow>, StudyError> {
        let mut record = csv::StringRecord::new();
        loop {
            let is_read = self.reader.read_record(&mut record);
            if !is_read.map_err(|source| StudyError::Csv { path: self.path.clone(), source })? {
                return Ok(None);
            }
            self.line += 1;
            let is_header = self.line == 1;
            if is_header != record.iter().eq(&self.columns) {
                return Err(self.refuse());
            }
            if is_header {
                continue;
            }
            let point = record.get(0).and_then(|field| field.parse().ok());
            return match point.filter(|point| *point < self.points) {
                Some(point) if record.len() == self.columns.len() => {
                    let fields = record.iter().map(str::to_owned).collect();
                    Ok(Some(ResultRow { point, fields }))
                }
                _ => Err(self.refuse()),
            };
        }
    }
}

impl Iterator for Rows {
    type Item = Result<ResultRow, StudyError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.read().transpose()
    }
}

/// The bytes of a file up to its last line feed.
fn whole_length(file: &mut File) -> io::Result<u64> {
    let mut block = [0; 4096];
    let mut end = file.seek(SeekFrom::End(0))?;
    let mut length = 0;
    while end > 0 {
        let start = end.saturating_sub(block.len() as u64);
        let part = &mut block[..(end - start) as usize];
        file.seek(SeekFrom::Start(start))?;
        file.read_exact(part)?;
        if let Some(last) = part.iter().rposition(|byte| *byte == b'\n') {
            length = start + last as u64 + 1;
            break;
        }
        end = start;
    }
    file.seek(SeekFrom::Start(0))?;
    Ok(length)
}

/// One line of CSV.
pub(crate) fn line(fields: &[String]) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(fields)?;
    writer.into_inner().map_err(csv::IntoInnerError::into_error)
}

/// The points of a sorted file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Merged {
    /// How many points have a row.
    pub count: usize,
    /// Those of them that failed, in every shard that has them.
    pub failures: Failures,
    /// How many points no shard has.
    pub missing: usize,
    /// The numbers of the first of these.
    pub first_missing: Vec<usize>,
}

/// How many missing points are named.
const NAMED: usize = 10;

/// Rows that come in any order and are written in the order of their points.
///
/// Both the rows and their places are on disk: a study may have more points than memory.
pub(crate) struct Sorter {
    target: PathBuf,
    rows: File,
    /// How long `rows` will be when everything is written.
    length: u64,
    /// The end of `rows` that is not written yet.
    pending: Vec<u8>,
    index: Index,
}

/// What is written at a time.
const BLOCK: usize = 1 << 16;

impl Sorter {
    /// An empty one; `target` is the file that [`finish`](Self::finish) writes.
    pub(crate) fn new(target: &Path) -> Result<Self, StudyError> {
        Ok(Self {
            target: target.to_owned(),
            rows: scratch(target, "rows").map_err(at(target))?,
            length: 0,
            pending: Vec::with_capacity(2 * BLOCK),
            index: Index::new(scratch(target, "index").map_err(at(target))?),
        })
    }

    /// Takes a row. Of two rows of one point, one that could be run displaces one that failed.
    ///
    /// # Errors
    ///
    /// Two different results of one point; `path` is where the second comes from.
    pub(crate) fn insert(&mut self, row: &ResultRow, path: &Path) -> Result<(), StudyError> {
        let has_failed = row.error().is_some();
        let text = line(&row.fields).map_err(at(path))?;
        let known = self.index.get(row.point).map_err(at(&self.target))?;
        match known {
            Some(_) if has_failed => return Ok(()),
            Some(place) if !place.has_failed => {
                let is_same = self.text(place).map_err(at(&self.target))? == text;
                let error = StudyError::TwoResults { point: row.point, path: path.to_owned() };
                return if is_same { Ok(()) } else { Err(error) };
            }
            _ => {}
        }
        self.append(row.point, &text, has_failed).map_err(at(&self.target))
    }

    fn append(&mut self, point: usize, text: &[u8], has_failed: bool) -> io::Result<()> {
        let place = Place { offset: self.length, length: text.len() as u64, has_failed };
        self.index.set(point, place)?;
        self.length += place.length;
        self.pending.extend(text);
        if self.pending.len() < BLOCK {
            return Ok(());
        }
        self.flush()
    }

    /// Writes the rows to the target.
    pub(crate) fn finish(mut self, plan: &Plan) -> Result<Merged, StudyError> {
        let target = self.target.clone();
        let new = target.with_extension(format!("{}.new", std::process::id()));
        self.write(&new, plan)
            .and_then(|merged| fs::rename(&new, &target).map(|()| merged))
            .map_err(at(&target))
    }

    fn write(&mut self, path: &Path, plan: &Plan) -> io::Result<Merged> {
        self.flush()?;
        let mut merged = Merged::default();
        let mut out = BufWriter::new(File::create(path)?);
        out.write_all(&line(&columns(plan))?)?;
        let mut rows = BufReader::with_capacity(BLOCK, &self.rows);
        rows.seek(SeekFrom::Start(0))?;
        let (mut position, mut text) = (0, Vec::new());
        for point in 0..plan.len() {
            let Some(place) = self.index.get(point)? else {
                merged.missing += 1;
                if merged.first_missing.len() < NAMED {
                    merged.first_missing.push(point);
                }
                continue;
            };
            // Relative, because that keeps what is buffered: most rows are nearly in order.
            rows.seek_relative(place.offset as i64 - position as i64)?;
            text.resize(place.length as usize, 0);
            rows.read_exact(&mut text)?;
            position = place.offset + place.length;
            out.write_all(&text)?;
            merged.count += 1;
            if place.has_failed {
                merged.failures.add(point, || reason(&text));
            }
        }
        out.flush()?;
        Ok(merged)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.rows.seek(SeekFrom::End(0))?;
        self.rows.write_all(&self.pending)?;
        self.pending.clear();
        Ok(())
    }

    fn text(&mut self, place: Place) -> io::Result<Vec<u8>> {
        self.flush()?;
        let mut text = vec![0; place.length as usize];
        self.rows.seek(SeekFrom::Start(place.offset))?;
        self.rows.read_exact(&mut text)?;
        Ok(text)
    }
}

/// Why a point failed, from its row.
fn reason(text: &[u8]) -> String {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_reader(text);
    let record = reader.records().next().and_then(Result::ok);
    let last = record.as_ref().and_then(|record| record.iter().next_back());
    last.unwrap_or_default().to_owned()
}

/// A file beside `target` that has no name any more, so that nothing is left of it.
fn scratch(target: &Path, kind: &str) -> io::Result<File> {
    let path = target.with_extension(format!("{}.{kind}", std::process::id()));
    let mut options = OpenOptions::new();
    let file = options.read(true).write(true).create(true).truncate(true).open(&path)?;
    fs::remove_file(&path)?;
    Ok(file)
}

/// The place of a row in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place {
    offset: u64,
    /// Greater than 0.
    length: u64,
    has_failed: bool,
}

/// The places of rows by point, in a file of which one page is in memory.
struct Index {
    file: File,
    page: Vec<u8>,
    number: usize,
    is_changed: bool,
}

/// Bytes of an entry: an offset, then twice the length, plus 1 if the point failed.
const ENTRY: usize = 16;
/// Entries of a page.
const PAGE: usize = 4096;

impl Index {
    fn new(file: File) -> Self {
        Self { file, page: vec![0; ENTRY * PAGE], number: 0, is_changed: false }
    }

    fn get(&mut self, point: usize) -> io::Result<Option<Place>> {
        let entry = self.entry(point)?;
        let mut numbers = entry.chunks_exact(8).map(|bytes| {
            let mut number = [0; 8];
            number.copy_from_slice(bytes);
            u64::from_le_bytes(number)
        });
        let (offset, length) = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
        let place = Place { offset, length: length / 2, has_failed: length % 2 == 1 };
        Ok((place.length > 0).then_some(place))
    }

    fn set(&mut self, point: usize, place: Place) -> io::Result<()> {
        let length = 2 * place.length + u64::from(place.has_failed);
        let (left, right) = self.entry(point)?.split_at_mut(8);
        left.copy_from_slice(&place.offset.to_le_bytes());
        right.copy_from_slice(&length.to_le_bytes());
        self.is_changed = true;
        Ok(())
    }

    /// A point's entry, in the page that is turned to.
    fn entry(&mut self, point: usize) -> io::Result<&mut [u8]> {
        if point / PAGE != self.number {
            self.turn_to(point / PAGE)?;
        }
        let start = point % PAGE * ENTRY;
        Ok(&mut self.page[start..start + ENTRY])
    }

    fn turn_to(&mut self, number: usize) -> io::Result<()> {
        let offset = |number: usize| SeekFrom::Start((number * PAGE * ENTRY) as u64);
        if self.is_changed {
            self.file.seek(offset(self.number))?;
            self.file.write_all(&self.page)?;
        }
        self.page.clear();
        self.file.seek(offset(number))?;
        (&self.file).take((PAGE * ENTRY) as u64).read_to_end(&mut self.page)?;
        // There is nothing yet behind the end of the file.
        self.page.resize(PAGE * ENTRY, 0);
        (self.number, self.is_changed) = (number, false);
        Ok(())
    }
}
