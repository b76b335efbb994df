//! Why a recording cannot be written or read.

use std::{io, path::PathBuf};

use mcap::McapError;
use mtj_model::scenario::ScenarioError;
use mtj_protocol::{admission::Rejection, sample::VERSION};

use crate::error::MonitorError;

/// Why a recording cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// A file of this name exists, and it must not be overwritten.
    #[error(
        "--record {}: the file exists; choose another one, or add --overwrite to lose what is in it",
        path.display()
    )]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file cannot be created.
    #[error("--record {}: {source}; choose a file that can be written", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The header of the recording cannot be written.
    #[error("--record {}: {source}; choose a file on a disk with space", path.display())]
    Header {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The limits of a file are none.
    #[error(
        "--record-split '{text}': expected a size of at least 100kB, a time of at least 1 s, or \
         both, like 100MB, 10min or 100MB,10min"
    )]
    Split {
        /// What the user wrote.
        text: String,
    },
    /// The time to keep is none.
    #[error("--record-last '{text}': expected a time from 1 s to 1 h, like 30s")]
    Last {
        /// What the user wrote.
        text: String,
    },
    /// The recorder's thread cannot be started.
    #[error("the recorder's thread could not be started: {0}")]
    Thread(io::Error),
    /// The file cannot be opened.
    #[error("{}: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is not an MCAP file.
    #[error("{}: not an MCAP file, which 'mtj monitor --record' makes", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// The file is damaged.
    #[error("{}: {source}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where.
        source: Box<McapError>,
    },
    /// The file's chunks are compressed in a way that this program does not read.
    #[error(
        "{}: its chunks are compressed with '{compression}', and mtj reads zstd, lz4 and \
         uncompressed ones; rewrite it with 'mcap compress --compression zstd'",
        path.display()
    )]
    Compression {
        /// The file.
        path: PathBuf,
        /// The compression's name in the file.
        compression: String,
    },
    /// A message cannot be read.
    #[error("{}: message {sequence} of {channel} cannot be read: {source}", path.display())]
    Message {
        /// The file.
        path: PathBuf,
        /// The message's number.
        sequence: u32,
        /// The message's channel.
        channel: String,
        /// Why.
        source: Box<MessageError>,
    },
}

impl From<RecordingError> for MonitorError {
    fn from(error: RecordingError) -> Self {
        let is_bad_input = error.is_bad_input();
        Self::of(error, is_bad_input)
    }
}

impl RecordingError {
    /// Whether the user can remedy it by another file or option.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Exists { .. }
            | Self::Create { .. }
            | Self::Header { .. }
            | Self::Split { .. }
            | Self::Last { .. }
            | Self::Open { .. }
            | Self::NotMcap { .. }
            | Self::Compression { .. } => true,
            Self::Thread(_) | Self::Damaged { .. } | Self::Message { .. } => false,
        }
    }
}

/// Why JSON is not a message.
#[derive(Debug, thiserror::Error)]
pub enum MessageError {
    /// It is not JSON, or its fields are others.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// It holds a scenario that is not valid.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// It holds a sample that no port would admit.
    #[error(transparent)]
    Sample(#[from] Rejection),
    /// It holds a sample of another protocol version, with other fields.
    #[error("it has protocol version {0}, and this program reads version {VERSION}")]
    Version(u32),
}
