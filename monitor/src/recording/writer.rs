//! Writes an MCAP file.

use std::{
    collections::BTreeMap,
    fmt,
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
    error::RecordingError,
    json,
    schema::schema,
    topic::{Counts, TOPICS, Topic, header},
};

/// Writes a recording: chunks are put together in memory and written as a whole, so that at any
/// moment all of the file but perhaps its last record can be read.
pub(crate) struct RecordingWriter {
    writer: Writer<NoSeek<BufWriter<File>>>,
    file: File,
    channels: [u16; TOPICS.len()],
    json: Vec<u8>,
    written: Counts,
    /// How many messages of each topic the operating system has.
    flushed: Counts,
    flushed_length: u64,
    /// How many bytes of JSON were added since.
    pending: u64,
}

impl fmt::Debug for RecordingWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RecordingWriter").field("flushed", &self.flushed).finish_non_exhaustive()
    }
}

impl RecordingWriter {
    /// Starts a recording in an empty file; `metadata` describes the whole recording.
    pub(crate) fn new(file: File, metadata: BTreeMap<String, String>) -> io::Result<Self> {
        let out = NoSeek::new(BufWriter::new(file.try_clone()?));
        Self::write_header(out, file, metadata).map_err(io_error)
    }

    fn write_header(
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
        let (written, flushed) = Default::default();
        let json = Vec::with_capacity(1024);
        let (flushed_length, pending) = (0, 0);
        let mut recording =
            Self { writer, file, channels, json, written, flushed, flushed_length, pending };
        recording.flush_chunk()?;
        Ok(recording)
    }

    /// Adds a message; a crash cannot lose it after the next [`Self::flush`].
    pub(crate) fn write(&mut self, log_time: u64, message: &Message) -> io::Result<()> {
        self.repeat(log_time, message)?;
        self.written[Topic::of(message) as usize] += 1;
        Ok(())
    }

    /// Adds a message that another file has already; it is not counted.
    pub(crate) fn repeat(&mut self, log_time: u64, message: &Message) -> io::Result<()> {
        let topic = Topic::of(message);
        self.json.clear();
        json::write(&mut self.json, message)?;
        let header = MessageHeader {
            channel_id: self.channels[topic as usize],
            sequence: header(message).map_or(0, |header| header.sequence as u32),
            log_time,
            publish_time: log_time,
        };
        self.pending += self.json.len() as u64;
        self.writer.write_to_known_channel(&header, &self.json).map_err(io_error)
    }

    /// Finishes the chunk and passes it to the operating system: a crash of this process does not
    /// lose it.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.flush_chunk().map_err(io_error)
    }

    fn flush_chunk(&mut self) -> McapResult<()> {
        self.writer.flush()?;
        self.flushed = self.written;
        self.note_length()?;
        Ok(())
    }

    fn note_length(&mut self) -> io::Result<()> {
        (self.flushed_length, self.pending) = (self.file.metadata()?.len(), 0);
        Ok(())
    }

    /// The length that the file has at most: as if the messages since the last flush were not
    /// compressed. After a flush it is the length of the file.
    pub(crate) fn longest(&self) -> u64 {
        self.flushed_length + self.pending
    }

    /// Finishes the file with its summary.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.flush()?;
        self.writer.finish().map_err(io_error)?;
        self.note_length()
    }

    /// How many messages of each topic the operating system has.
    pub(crate) fn flushed(&self) -> Counts {
        self.flushed
    }

    /// Gives up: truncates the file after the last flush, so that it ends with a whole record.
    pub(crate) fn abandon(self) -> io::Result<()> {
        drop(self.writer);
        self.file.set_len(self.flushed_length)
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Creates the file of a recording; a file that exists is an error unless it may be overwritten.
pub(crate) fn create(path: &Path, overwrite: bool) -> Result<File, RecordingError> {
    let file = if overwrite { File::create(path) } else { File::create_new(path) };
    let path = path.to_owned();
    file.map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => RecordingError::Exists { path },
        _ => RecordingError::Create { path, source },
    })
}
