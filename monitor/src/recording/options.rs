//! The command line of recording.

use std::{
    path::PathBuf,
    sync::mpsc::Receiver,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use clap::Args;
use mtj_model::scenario::{BusSettings, duration};

use super::{
    error::RecordingError,
    numbered::NumberedFiles,
    parts::{Metadata, PartWriter},
    recorder::Recorder,
    ring_recorder::RingRecorder,
    save::{SaveHandle, SaveRequest},
    split::SplitLimits,
    writer::{self, RecordingWriter},
};
use crate::{filter::Filter, monitor::Sink};

/// The shortest and the longest time that --record-last keeps.
const LAST: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(3600));

/// Whether and where a session is recorded.
#[derive(Args, Clone, Debug, Default)]
pub struct RecordingOptions {
    /// Record every sample of every topic in an MCAP file, for Foxglove, PlotJuggler, 'mtj export'
    /// and 'mtj replay'
    #[arg(long, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Let --record replace a file that is there already
    #[arg(long, requires = "record")]
    pub overwrite: bool,
    /// Begin another file, FILE-0001.mcap, FILE-0002.mcap, …, when one has this size or this time,
    /// like 100MB, 10min or 100MB,10min
    #[arg(
        long,
        value_name = "SIZE,TIME",
        requires = "record",
        conflicts_with_all = ["overwrite", "record_last"]
    )]
    pub record_split: Option<String>,
    /// Keep the last seconds in memory, and save them in FILE-0001.mcap, FILE-0002.mcap, … when an
    /// alarm begins, at SIGUSR1, or when the dashboard asks for it
    #[arg(long, value_name = "TIME", requires = "record", conflicts_with = "overwrite")]
    pub record_last: Option<String>,
}

/// A recording that is ready to start, without messages yet.
#[derive(Debug)]
pub struct NewRecording {
    kind: Kind,
    filter: Filter,
}

#[derive(Debug)]
enum Kind {
    /// All messages in files.
    All(Box<PartWriter>),
    /// The last seconds, saved on request.
    Last {
        path: PathBuf,
        files: NumberedFiles,
        metadata: Metadata,
        time: Duration,
        saves: (SaveHandle, Receiver<SaveRequest>),
    },
}

impl RecordingOptions {
    /// Creates the file, so that a path that cannot be written is reported before anything starts.
    ///
    /// Of the messages, `filter` decides which are recorded.
    pub fn create(
        &self,
        bus: &BusSettings,
        filter: Filter,
    ) -> Result<Option<NewRecording>, RecordingError> {
        let Some(path) = self.record.clone() else { return Ok(None) };
        let metadata = metadata(bus, &filter);
        let kind = match (&self.record_split, &self.record_last) {
            (_, Some(text)) => {
                let time = last(text)?;
                let failed = |source| RecordingError::Create { path: path.clone(), source };
                let mut files = NumberedFiles::open(&path).map_err(failed)?;
                files.check().map_err(failed)?;
                Kind::Last { path, files, metadata, time, saves: SaveHandle::new() }
            }
            (Some(text), None) => {
                let limits: SplitLimits = text.parse()?;
                let failed = |source| RecordingError::Create { path: path.clone(), source };
                let files = NumberedFiles::open(&path).map_err(failed)?;
                let writer = PartWriter::split(files, limits, metadata).map_err(failed)?;
                Kind::All(Box::new(writer))
            }
            (None, None) => {
                let file = writer::create(&path, self.overwrite)?;
                let writer = RecordingWriter::new(file, metadata)
                    .map_err(|source| RecordingError::Header { path: path.clone(), source })?;
                Kind::All(Box::new(PartWriter::single(path, writer)))
            }
        };
        Ok(Some(NewRecording { kind, filter }))
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let record = self.record.as_ref().map(|path| path.display().to_string());
        let options = [
            ("--record", record),
            ("--record-split", self.record_split.clone()),
            ("--record-last", self.record_last.clone()),
        ];
        let given = options.into_iter().filter_map(|(flag, value)| Some([flag.to_owned(), value?]));
        given.flatten().chain(self.overwrite.then(|| "--overwrite".to_owned())).collect()
    }
}

/// The time of --record-last.
fn last(text: &str) -> Result<Duration, RecordingError> {
    let time = duration::parse(text).filter(|time| (LAST.0..=LAST.1).contains(time));
    time.ok_or_else(|| RecordingError::Last { text: text.to_owned() })
}

fn metadata(bus: &BusSettings, filter: &Filter) -> Metadata {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let entries = [
        ("version", env!("CARGO_PKG_VERSION").to_owned()),
        ("protocol", mtj_protocol::sample::VERSION.to_string()),
        ("session", bus.session.clone()),
        ("bus", bus.kind.name().to_owned()),
        ("since_ns", since.as_nanos().to_string()),
    ]
    .map(|(key, value)| (key.to_owned(), value));
    entries.into_iter().chain(filter.metadata()).collect()
}

impl NewRecording {
    /// Saves what --record-last keeps; `None` for a recording of everything.
    pub fn save_handle(&self) -> Option<SaveHandle> {
        match &self.kind {
            Kind::All(_) => None,
            Kind::Last { saves: (handle, _), .. } => Some(handle.clone()),
        }
    }

    /// Starts to record.
    pub fn start(self) -> Result<Box<dyn Sink>, RecordingError> {
        let sink: Box<dyn Sink> = match self.kind {
            Kind::All(writer) => {
                Box::new(Recorder::start(*writer, self.filter).map_err(RecordingError::Thread)?)
            }
            Kind::Last { path, files, metadata, time, saves } => {
                let ring = RingRecorder::start(&path, files, metadata, time, saves, self.filter);
                Box::new(ring.map_err(RecordingError::Thread)?)
            }
        };
        Ok(sink)
    }
}
