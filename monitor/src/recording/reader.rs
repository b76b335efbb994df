//! Reads a recording, message by message.

use std::{
    fmt,
    fs::File,
    io::{BufReader, Read, Seek},
    path::{Path, PathBuf},
};

use mcap::{McapError, io::MessageReader, sans_io::linear_reader::LinearReaderOptions};
use mtj_protocol::port::Message;

use super::{error::RecordingError, json, topic::Topic};

/// The largest chunk that is read: more than the recorder writes, so that no file of another
/// program can take all memory.
const LARGEST_CHUNK: usize = 1 << 26;

/// A recording that is read from front to back, one chunk at a time.
///
/// A recording that was cut short, as when its recorder was killed, ends with its last whole chunk.
pub struct Recording {
    path: PathBuf,
    messages: MessageReader<BufReader<File>>,
    is_cut_short: bool,
}

impl fmt::Debug for Recording {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recording").field("path", &self.path).finish_non_exhaustive()
    }
}

/// A message of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedMessage {
    /// Its time, ns since 1970.
    pub log_time: u64,
    /// The message itself.
    pub message: Message,
}

impl Recording {
    /// Opens a recording.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let file = open(path)?;
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LARGEST_CHUNK);
        let messages = MessageReader::new_with_options(BufReader::new(file), options);
        Ok(Self { path: path.to_owned(), messages, is_cut_short: false })
    }

    /// Whether the recording was cut short; known after the last message.
    pub fn is_cut_short(&self) -> bool {
        self.is_cut_short
    }

    fn unreadable(&self, error: McapError) -> RecordingError {
        let path = self.path.clone();
        match error {
            McapError::UnsupportedCompression(compression) => {
                RecordingError::Compression { path, compression }
            }
            other => RecordingError::Damaged { path, source: Box::new(other) },
        }
    }
}

fn open(path: &Path) -> Result<File, RecordingError> {
    let failed = |source| RecordingError::Open { path: path.to_owned(), source };
    let mut file = File::open(path).map_err(failed)?;
    let mut magic = [0; mcap::MAGIC.len()];
    let is_mcap = file.read_exact(&mut magic).is_ok() && magic == mcap::MAGIC;
    if !is_mcap {
        return Err(RecordingError::NotMcap { path: path.to_owned() });
    }
    file.rewind().map_err(failed)?;
    Ok(file)
}

impl Iterator for Recording {
    type Item = Result<RecordedMessage, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let message = match self.messages.next()? {
                Ok(message) => message,
                Err(McapError::UnexpectedEof) => {
                    self.is_cut_short = true;
                    return None;
                }
                Err(error) => return Some(Err(self.unreadable(error))),
            };
            let channel = &message.channel.topic;
            // Other programs may have added their channels to the file.
            let Some(topic) = Topic::of_channel(channel) else { continue };
            let log_time = message.log_time;
            return Some(match json::read(topic, &message.data) {
                Ok(message) => Ok(RecordedMessage { log_time, message }),
                Err(error) => Err(RecordingError::Message {
                    path: self.path.clone(),
                    sequence: message.sequence,
                    channel: channel.clone(),
                    source: Box::new(error),
                }),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mtj_protocol::sample::{Header, StateSample};

    use super::*;
    use crate::recording::writer::RecordingWriter;

    #[test]
    fn a_recording_of_another_protocol_version_is_refused_in_one_sentence() {
        let path = std::env::temp_dir().join(format!("mtj-version-{}.mcap", std::process::id()));
        let file = File::create(&path).unwrap();
        let mut writer = RecordingWriter::new(file, BTreeMap::new()).unwrap();
        let header = Header { version: 3, joints: 2, axes: 2, ..Header::default() };
        let state = StateSample { header, ..Default::default() };
        writer.write(0, &Message::State(state)).unwrap();
        writer.finish().unwrap();
        let error = Recording::open(&path).unwrap().next().unwrap().unwrap_err();
        std::fs::remove_file(&path).unwrap();
        let expected = format!(
            "message 0 of /mtj/state cannot be read: it has protocol version 3, and this program reads \
             version {}",
            mtj_protocol::sample::VERSION
        );
        assert_eq!(error.to_string(), format!("{}: {expected}", path.display()));
    }
}
