//! The command line of recording.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    time::{SystemTime, UNIX_EPOCH},
};

use clap::Args;
use mtj_model::scenario::BusSettings;

use super::{
    error::RecordingError,
    recorder::Recorder,
    writer::{self, RecordingWriter},
};

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
}

/// A recording whose file was created, without messages yet.
#[derive(Debug)]
pub struct NewRecording {
    path: PathBuf,
    writer: RecordingWriter,
}

impl RecordingOptions {
    /// Creates the file, so that a path that cannot be written is reported before anything starts.
    pub fn create(&self, bus: &BusSettings) -> Result<Option<NewRecording>, RecordingError> {
        let Some(path) = &self.record else { return Ok(None) };
        let file = writer::create(path, self.overwrite)?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let metadata = BTreeMap::from(
            [
                ("version", env!("CARGO_PKG_VERSION").to_owned()),
                ("protocol", mtj_protocol::sample::VERSION.to_string()),
                ("session", bus.session.clone()),
                ("bus", bus.kind.name().to_owned()),
                ("since_ns", since.as_nanos().to_string()),
            ]
            .map(|(key, value)| (key.to_owned(), value)),
        );
        let path = path.clone();
        match RecordingWriter::new(file, metadata) {
            Ok(writer) => Ok(Some(NewRecording { path, writer })),
            Err(source) => Err(RecordingError::Header { path, source }),
        }
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let record = self.record.iter().map(|path| path.display().to_string());
        let record = record.flat_map(|path| ["--record".to_owned(), path]);
        record.chain(self.overwrite.then(|| "--overwrite".to_owned())).collect()
    }
}

impl NewRecording {
    /// Starts to record.
    pub fn start(self) -> Result<Recorder, RecordingError> {
        Recorder::start(self.path, self.writer).map_err(RecordingError::Thread)
    }
}
