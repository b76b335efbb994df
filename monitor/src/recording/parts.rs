//! Writes a recording to one file, or to one numbered file after another.

use std::{
    collections::BTreeMap,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
};

use mtj_protocol::port::Message;
use tracing::info;

use super::{numbered::NumberedFiles, split::SplitLimits, topic::Counts, writer::RecordingWriter};

/// Describes a recording, in its file.
pub(super) type Metadata = BTreeMap<String, String>;

/// Writes a recording; with limits, in parts that can each be read without the others.
///
/// Each message is in exactly one part. Only the scenario in effect is written once more at the
/// beginning of a part.
#[derive(Debug)]
pub(super) struct PartWriter {
    first: PathBuf,
    path: PathBuf,
    writer: RecordingWriter,
    /// How many messages of each topic are in the parts before.
    finished: Counts,
    scenario: Option<Message>,
    split: Option<Split>,
}

#[derive(Debug)]
struct Split {
    limits: SplitLimits,
    files: NumberedFiles,
    metadata: Metadata,
    /// The earliest time in this part, ns since 1970.
    begin: Option<u64>,
}

impl PartWriter {
    /// Writes one file.
    pub(super) fn single(path: PathBuf, writer: RecordingWriter) -> Self {
        let (first, finished) = (path.clone(), Counts::default());
        Self { first, path, writer, finished, scenario: None, split: None }
    }

    /// Writes one file after another; each ends at one of the limits.
    pub(super) fn split(
        mut files: NumberedFiles,
        limits: SplitLimits,
        metadata: Metadata,
    ) -> io::Result<Self> {
        let (path, writer) = create(&mut files, &metadata)?;
        let split = Some(Split { limits, files, metadata, begin: None });
        Ok(Self { split, ..Self::single(path, writer) })
    }

    /// The file that is written.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Adds a message, to the next part if this one has reached a limit.
    pub(super) fn write(&mut self, log_time: u64, message: &Message) -> io::Result<()> {
        if self.is_part_full(log_time)? {
            self.begin_part(log_time, message)?;
        }
        if matches!(message, Message::Scenario(_)) {
            self.scenario = Some(message.clone());
        }
        self.writer.write(log_time, message)
    }

    fn is_part_full(&mut self, log_time: u64) -> io::Result<bool> {
        let Some(Split { limits, begin, .. }) = &mut self.split else { return Ok(false) };
        let earliest = begin.get_or_insert(log_time);
        *earliest = log_time.min(*earliest);
        let elapsed = u128::from(log_time - *earliest);
        if limits.time.is_some_and(|most| elapsed >= most.as_nanos()) {
            return Ok(true);
        }
        let Some(most) = limits.bytes.filter(|most| self.writer.longest() >= *most) else {
            return Ok(false);
        };
        self.writer.flush()?;
        Ok(self.writer.longest() >= most)
    }

    fn begin_part(&mut self, log_time: u64, message: &Message) -> io::Result<()> {
        let Some(split) = &mut self.split else { return Ok(()) };
        self.writer.finish()?;
        let (path, writer) = create(&mut split.files, &split.metadata)?;
        for (sum, count) in self.finished.iter_mut().zip(self.writer.flushed()) {
            *sum += count;
        }
        (self.path, self.writer, split.begin) = (path, writer, Some(log_time));
        info!("the recording goes on in {}", self.path.display());
        match &self.scenario {
            Some(scenario) if !matches!(message, Message::Scenario(_)) => {
                self.writer.repeat(log_time, scenario)
            }
            _ => Ok(()),
        }
    }

    /// Makes sure that a crash does not lose what was written.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.writer.flush()
    }

    /// Finishes the last file.
    pub(super) fn finish(&mut self) -> io::Result<()> {
        self.writer.finish()
    }

    /// Gives up after an error; returns what the operating system has.
    pub(super) fn end(self, is_error: bool) -> PartsWritten {
        let mut counts = self.finished;
        for (sum, count) in counts.iter_mut().zip(self.writer.flushed()) {
            *sum += count;
        }
        if is_error {
            // The disk is full or gone: a second error tells nothing new.
            let _ = self.writer.abandon();
        }
        PartsWritten { first: self.first, last: self.path, counts }
    }
}

/// What was written.
#[derive(Debug)]
pub(super) struct PartsWritten {
    pub first: PathBuf,
    pub last: PathBuf,
    pub counts: Counts,
}

impl PartsWritten {
    /// The file, or the first and the last of the parts.
    pub(super) fn files(&self) -> String {
        let (first, last) = (self.first.display(), self.last.display());
        if self.first == self.last { first.to_string() } else { format!("{first} to {last}") }
    }
}

/// Starts the next numbered file; it is removed if not even its header can be written.
pub(super) fn create(
    files: &mut NumberedFiles,
    metadata: &Metadata,
) -> io::Result<(PathBuf, RecordingWriter)> {
    let (path, number, file) = files.create()?;
    match start(file, number, metadata) {
        Ok(writer) => Ok((path, writer)),
        Err(error) => {
            let _ = fs::remove_file(&path);
            Err(error)
        }
    }
}

fn start(file: File, number: u32, metadata: &Metadata) -> io::Result<RecordingWriter> {
    let mut metadata = metadata.clone();
    metadata.insert("part".to_owned(), number.to_string());
    RecordingWriter::new(file, metadata)
}
