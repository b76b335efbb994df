//! A recording, message by message.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek},
    path::{Path, PathBuf},
};

use mcap::{McapError, io::MessageReader, sans_io::linear_reader::LinearReaderOptions};
use mtj_protocol::port::Message;

use super::{json, topic::Topic};

/// No chunk of ours is nearly as large, so that a file that is none of ours cannot take all memory.
const LARGEST_CHUNK: usize = 1 << 26;

/// A recording that is read from front to back, a chunk at a time.
///
/// One that was cut short, as by a kill, simply ends with its last whole chunk.
pub struct Recording {
    path: PathBuf,
    messages: MessageReader<BufReader<File>>,
    is_cut_short: bool,
}

/// A message of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// When it was, ns since 1970.
    pub log_time: u64,
    /// What was said.
    pub message: Message,
}

impl Recording {
    /// Opens a recording; in words, if that cannot be.
    pub fn open(path: &Path) -> Result<Self, String> {
        let file = open(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LARGEST_CHUNK);
        let messages = MessageReader::new_with_options(BufReader::new(file), options);
        Ok(Self { path: path.to_owned(), messages, is_cut_short: false })
    }

    /// Whether the file ended before its end; known after the last message.
    pub fn is_cut_short(&self) -> bool {
        self.is_cut_short
    }

    fn refuse(&self, reason: &dyn std::fmt::Display) -> String {
        format!("{}: {reason}", self.path.display())
    }
}

fn open(path: &Path) -> io::Result<File> {
    let mut file = File::open(path)?;
    let mut magic = [0; mcap::MAGIC.len()];
    let is_mcap = file.read_exact(&mut magic).is_ok() && magic == mcap::MAGIC;
    if !is_mcap {
        return Err(io::Error::other("not an MCAP file, which 'mtj monitor --record' makes"));
    }
    file.rewind()?;
    Ok(file)
}

impl Iterator for Recording {
    type Item = Result<Recorded, String>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let message = match self.messages.next()? {
                Ok(message) => message,
                Err(McapError::UnexpectedEof) => {
                    self.is_cut_short = true;
                    return None;
                }
                Err(error) => return Some(Err(self.refuse(&error))),
            };
            // Others may have recorded into the same file.
            let Some(topic) = Topic::of_channel(&message.channel.topic) else { continue };
            let read = json::read(topic, &message.data).map_err(|fault| {
                self.refuse(&format!(
                    "message {} of {} cannot be read: {fault}",
                    message.sequence, message.channel.topic
                ))
            });
            return Some(read.map(|read| Recorded { log_time: message.log_time, message: read }));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mtj_protocol::sample::{Header, StateSample};

    use super::*;
    use crate::recording::file::RecordingFile;

    #[test]
    fn a_recording_of_another_protocol_version_is_refused_in_one_sentence() {
        let path = std::env::temp_dir().join(format!("mtj-version-{}.mcap", std::process::id()));
        let mut file = RecordingFile::begin(File::create(&path).unwrap(), BTreeMap::new()).unwrap();
        let header = Header { version: 3, joints: 2, axes: 2, ..Header::default() };
        let state = StateSample { header, ..Default::default() };
        file.write(0, &Message::State(state)).unwrap();
        file.finish().unwrap();
        let sentence = Recording::open(&path).unwrap().next().unwrap().unwrap_err();
        std::fs::remove_file(&path).unwrap();
        let expected = "message 0 of /mtj/state cannot be read: it has protocol version 3, and this \
                        program reads version 4";
        assert_eq!(sentence, format!("{}: {expected}", path.display()));
    }
}
