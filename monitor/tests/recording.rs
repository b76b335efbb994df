//! Recordings through the crate's public surface: what was handed to a recorder is read back.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]
#![allow(unreachable_pub, dead_code, reason = "a module of a test binary")]

mod session;

use std::{
    fs,
    path::{Path, PathBuf},
    process,
    sync::atomic::{AtomicU64, Ordering},
};

use mcap::{Compression, WriteOptions};
use mtj_monitor::{
    monitor::Sink,
    recording::{RecordedMessage, Recording, RecordingError, options::RecordingOptions},
};
use mtj_protocol::port::Message;

use session::{instant, offered, scenario};

/// A folder that is removed with the test.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("mtj-recording-{}-{count}", process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// The names of the files in it, in order.
    fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(&self.0).unwrap().flatten();
        let mut names: Vec<String> =
            entries.map(|entry| entry.file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Records the messages with these options.
fn record(options: &RecordingOptions, messages: &[Message]) {
    let mut recorder = options.create(&scenario().bus).unwrap().unwrap().start().unwrap();
    for message in messages {
        recorder.handle(message);
    }
    assert!(recorder.refresh().unwrap());
}

fn to(file: &Path) -> RecordingOptions {
    RecordingOptions { record: Some(file.to_owned()), ..Default::default() }
}

/// A second of a session, or some.
fn messages(samples: u64) -> Vec<Message> {
    std::iter::once(offered(0)).chain((0..samples).flat_map(instant)).collect()
}

fn read(file: &Path) -> Vec<RecordedMessage> {
    Recording::open(file).unwrap().collect::<Result<_, _>>().unwrap()
}

/// Writes all of a recording to another file, in chunks of another compression.
fn rewrite(from: &Path, to: &Path, compression: Option<Compression>) {
    let options = WriteOptions::new().compression(compression).chunk_size(Some(20_000));
    let mut writer = options.create(fs::File::create(to).unwrap()).unwrap();
    for message in mcap::MessageStream::new(&fs::read(from).unwrap()).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
}

fn contains(file: &Path, bytes: &[u8]) -> bool {
    fs::read(file).unwrap().windows(bytes.len()).any(|window| window == bytes)
}

#[test]
fn a_recording_in_chunks_of_zstd_or_without_compression_has_the_same_messages() {
    let folder = Folder::new();
    let original = folder.file("run.mcap");
    record(&to(&original), &messages(200));
    let expected = read(&original);
    assert_eq!(expected.len(), 601);
    for (compression, name) in [(Some(Compression::Zstd), "zstd"), (None, "none")] {
        let copy = folder.file(&format!("{name}.mcap"));
        rewrite(&original, &copy, compression);
        assert_eq!(contains(&copy, b"zstd"), compression.is_some(), "{name}");
        assert!(!contains(&copy, b"lz4"), "{name}");
        assert!(read(&copy) == expected, "{name}");
    }
}

#[test]
fn a_compression_that_mtj_does_not_read_is_told_with_the_remedy() {
    let folder = Folder::new();
    let file = folder.file("run.mcap");
    record(&to(&file), &messages(20));
    let mut bytes = fs::read(&file).unwrap();
    let places: Vec<usize> =
        (0..bytes.len() - 3).filter(|i| &bytes[*i..*i + 3] == b"lz4").collect();
    for place in places {
        bytes[place..place + 3].copy_from_slice(b"xor");
    }
    fs::write(&file, bytes).unwrap();
    let error = Recording::open(&file).unwrap().find_map(Result::err).unwrap();
    assert!(
        matches!(&error, RecordingError::Compression { compression, .. } if compression == "xor")
    );
    assert!(error.is_bad_input());
    let sentence = error.to_string();
    for word in [file.to_str().unwrap(), "'xor'", "zstd, lz4", "mcap compress"] {
        assert!(sentence.contains(word), "{word}: {sentence}");
    }
}
