//! The command line of recording.

use std::{
    collections::BTreeMap,
    path::PathBuf,
    time::{SystemTime, UNIX_EPOCH},
};

use clap::Args;
use mtj_model::scenario::BusSettings;
use mtj_protocol::bus::BusError;

use super::{
    file::{self, RecordingFile},
    recorder::Recorder,
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

/// A recording whose file is there, and that has heard nothing yet.
pub struct Begun {
    path: PathBuf,
    file: RecordingFile,
}

impl RecordingOptions {
    /// Creates the file, so that a path that cannot be written is known before anything else is done.
    pub fn begin(&self, bus: &BusSettings) -> Result<Option<Begun>, BusError> {
        let Some(path) = &self.record else { return Ok(None) };
        let file =
            file::create(path, self.overwrite).map_err(|error| BusError::Settings(error.into()))?;
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
        match RecordingFile::begin(file, metadata) {
            Ok(file) => Ok(Some(Begun { path: path.clone(), file })),
            Err(error) => Err(BusError::Settings(
                format!("--record {}: {error}; choose a file on a disk with space", path.display())
                    .into(),
            )),
        }
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let record = self.record.iter().map(|path| path.display().to_string());
        let record = record.flat_map(|path| ["--record".to_owned(), path]);
        record.chain(self.overwrite.then(|| "--overwrite".to_owned())).collect()
    }
}

impl Begun {
    /// Records from now on, which it says.
    pub fn start(self) -> Result<Recorder, BusError> {
        Recorder::start(&self.path, self.file).map_err(|error| {
            BusError::Transport(
                format!("the recorder's thread could not be started: {error}").into(),
            )
        })
    }
}
