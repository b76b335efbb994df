//! The MCAP file that is written.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{self, BufWriter},
    path::Path,
};

use mcap::{
    Compression, McapError, McapResult, WriteOptions, Writer,
    records::{MessageHeader, Metadata},
    write::NoSeek,
};
use mtj_protocol::port::Message;

use super::{
    json,
    schema::schema,
    topic::{Counts, TOPICS, Topic, header},
};

/// A recording that grows: chunks are put together in memory and written as a whole, so that at any
/// moment all of the file but perhaps its last record can be read.
pub struct RecordingFile {
    writer: Writer<NoSeek<BufWriter<File>>>,
    file: File,
    channels: [u16; TOPICS.len()],
    json: Vec<u8>,
    written: Counts,
    safe: Counts,
    safe_length: u64,
}

impl RecordingFile {
    /// Begins a recording in an empty file; `metadata` are about all of it.
    pub fn begin(file: File, metadata: BTreeMap<String, String>) -> io::Result<Self> {
        let out = NoSeek::new(BufWriter::new(file.try_clone()?));
        Self::lay_out(out, file, metadata).map_err(io_error)
    }

    fn lay_out(
        out: NoSeek<BufWriter<File>>,
        file: File,
        metadata: BTreeMap<String, String>,
    ) -> McapResult<Self> {
        let mut writer = WriteOptions::new()
            .compression(Some(Compression::Lz4))
            .library(format!("mtj {} {}", env!("CARGO_PKG_VERSION"), mcap::LIBRARY_IDENTIFIER))
            .disable_seeking(true)
            .create(out)?;
        writer.write_metadata(&Metadata { name: "mtj".to_owned(), metadata })?;
        let mut channels = [0; TOPICS.len()];
        for topic in TOPICS {
            let name = format!("mtj.{}", topic.name());
            let text = schema(topic).to_string();
            let schema = writer.add_schema(&name, "jsonschema", text.as_bytes())?;
            channels[topic as usize] =
                writer.add_channel(schema, &topic.channel(), "json", &BTreeMap::new())?;
        }
        let (written, safe) = Default::default();
        let json = Vec::with_capacity(1024);
        let mut recording = Self { writer, file, channels, json, written, safe, safe_length: 0 };
        recording.write_out()?;
        Ok(recording)
    }

    /// Adds a message; it is safe after the next [`Self::flush`].
    pub fn write(&mut self, log_time: u64, message: &Message) -> io::Result<()> {
        let topic = Topic::of(message);
        self.json.clear();
        json::write(&mut self.json, message)?;
        let header = MessageHeader {
            channel_id: self.channels[topic as usize],
            sequence: header(message).map_or(0, |header| header.sequence as u32),
            log_time,
            publish_time: log_time,
        };
        self.writer.write_to_known_channel(&header, &self.json).map_err(io_error)?;
        self.written[topic as usize] += 1;
        Ok(())
    }

    /// Finishes the chunk and hands all of it to the system: what was written is safe, whatever
    /// becomes of this process.
    pub fn flush(&mut self) -> io::Result<()> {
        self.write_out().map_err(io_error)
    }

    fn write_out(&mut self) -> McapResult<()> {
        self.writer.flush()?;
        self.safe = self.written;
        self.safe_length = self.file.metadata()?.len();
        Ok(())
    }

    /// Finishes the file with its summary.
    pub fn finish(&mut self) -> io::Result<()> {
        self.flush()?;
        self.writer.finish().map_err(io_error)?;
        Ok(())
    }

    /// How many messages are safe, of each topic.
    pub fn safe(&self) -> Counts {
        self.safe
    }

    /// Gives up: takes back what was written in part, so that the file ends with a whole record.
    pub fn abandon(self) -> io::Result<()> {
        drop(self.writer);
        self.file.set_len(self.safe_length)
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Creates the file of a recording, which must not be there yet unless it may be overwritten; in
/// words, if that cannot be.
pub fn create(path: &Path, overwrite: bool) -> Result<File, String> {
    let file = if overwrite { File::create(path) } else { File::create_new(path) };
    file.map_err(|error| {
        let remedy = match error.kind() {
            io::ErrorKind::AlreadyExists => {
                "the file exists; choose another one, or add --overwrite to lose what is in it"
                    .to_owned()
            }
            _ => format!("{error}; choose a file that can be written"),
        };
        format!("--record {}: {remedy}", path.display())
    })
}
