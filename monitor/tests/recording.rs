//! Recordings through the crate's public surface: what was handed to a recorder is read back.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]
#![allow(unreachable_pub, dead_code, reason = "a module of a test binary")]

mod session;

use std::{
    fs,
    path::{Path, PathBuf},
    process,
    sync::{
        atomic::{AtomicU64, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use mcap::{Compression, WriteOptions};
use mtj_monitor::{
    filter::Filter,
    monitor::Sink,
    recording::{
        RecordedMessage, Recording, RecordingError, SaveError, SaveHandle, SaveOutcome,
        options::RecordingOptions,
    },
};
use mtj_protocol::port::Message;

use session::{PERIOD_NS, instant, offered, scenario, state, status, torque};

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
    let mut recorder =
        options.create(&scenario().bus, Filter::default()).unwrap().unwrap().start().unwrap();
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

/// The messages of each file, which must all be finished.
fn read_parts(folder: &Folder) -> Vec<Vec<RecordedMessage>> {
    let read_whole = |name: &String| {
        let mut part = Recording::open(&folder.file(name)).unwrap();
        let messages = part.by_ref().collect::<Result<Vec<_>, _>>().unwrap();
        assert!(!part.is_cut_short(), "{name}");
        messages
    };
    folder.names().iter().map(read_whole).collect()
}

/// The sequence numbers of the states among some messages.
fn states(messages: &[RecordedMessage]) -> Vec<u64> {
    let sequence = |recorded: &RecordedMessage| match &recorded.message {
        Message::State(state) => Some(state.header.sequence),
        _ => None,
    };
    messages.iter().filter_map(sequence).collect()
}

fn revision(message: &Message) -> u32 {
    match message {
        Message::Scenario(offered) => offered.revision,
        other => panic!("no scenario: {other:?}"),
    }
}

fn split_at(file: &Path, limits: &str) -> RecordingOptions {
    RecordingOptions { record_split: Some(limits.to_owned()), ..to(file) }
}

#[test]
fn parts_of_a_size_have_every_message_once_and_each_begins_with_the_scenario_in_effect() {
    let folder = Folder::new();
    let mut all = messages(4000);
    all.insert(6000, offered(1));
    record(&split_at(&folder.file("run.mcap"), "100kB"), &all);
    let names = folder.names();
    assert!(names.len() > 3, "{names:?}");
    assert_eq!(names[..2], ["run-0001.mcap", "run-0002.mcap"]);
    for name in &names[..names.len() - 1] {
        let length = fs::metadata(folder.file(name)).unwrap().len();
        assert!((100_000..150_000).contains(&length), "{name} has {length} bytes");
    }
    let parts = read_parts(&folder);
    let mut joined = Vec::new();
    let mut in_effect = 0;
    for (number, part) in parts.iter().enumerate() {
        let begin = &part[0];
        assert!(
            begin.log_time <= part[1].log_time && part[1].log_time - begin.log_time < PERIOD_NS
        );
        assert_eq!(revision(&begin.message), in_effect, "part {number}");
        // Later parts repeat it.
        let new = if number == 0 { &part[..] } else { &part[1..] };
        for recorded in new {
            if matches!(recorded.message, Message::Scenario(_)) {
                in_effect = revision(&recorded.message);
            }
            joined.push(recorded.message.clone());
        }
    }
    assert_eq!(in_effect, 1, "the change is in one of the parts");
    assert!(joined == all, "{} of {} messages", joined.len(), all.len());
}

#[test]
fn parts_of_a_time_have_no_more_than_that_time() {
    let folder = Folder::new();
    let all = messages(3500);
    record(&split_at(&folder.file("run.mcap"), "1s,1GB"), &all);
    let parts = read_parts(&folder);
    assert_eq!(parts.len(), 4);
    for part in &parts {
        let times = part.iter().map(|recorded| recorded.log_time);
        let span = times.clone().max().unwrap() - times.min().unwrap();
        assert!(span < 1_000_000_000, "{span} ns");
    }
    let sequences: Vec<u64> = parts.iter().flat_map(|part| states(part)).collect();
    assert_eq!(sequences, (0..3500).collect::<Vec<_>>());
}

#[test]
fn a_second_recording_in_parts_goes_on_after_the_numbers_that_are_there() {
    let folder = Folder::new();
    fs::write(folder.file("run-7.mcap"), "not numbered by mtj").unwrap();
    let options = split_at(&folder.file("run.mcap"), "1h");
    record(&options, &messages(10));
    let first = fs::read(folder.file("run-0001.mcap")).unwrap();
    record(&options, &messages(20));
    assert_eq!(folder.names(), ["run-0001.mcap", "run-0002.mcap", "run-7.mcap"]);
    assert!(fs::read(folder.file("run-0001.mcap")).unwrap() == first);
    assert_eq!(states(&read(&folder.file("run-0002.mcap"))).len(), 20);
}

#[test]
fn limits_that_are_none_are_told_with_option_and_value() {
    let folder = Folder::new();
    let file = folder.file("run.mcap");
    let last = |text: &str| RecordingOptions { record_last: Some(text.to_owned()), ..to(&file) };
    for (options, words) in [
        (split_at(&file, "100"), ["--record-split '100'", "100MB,10min"]),
        (split_at(&file, "1kB"), ["--record-split '1kB'", "at least 100kB"]),
        (last("30"), ["--record-last '30'", "like 30s"]),
        (last("2h"), ["--record-last '2h'", "to 1 h"]),
        (last("10ms"), ["--record-last '10ms'", "from 1 s"]),
        (split_at(Path::new("/nowhere/run.mcap"), "1h"), ["/nowhere/run.mcap", "No such file"]),
    ] {
        let error = options.create(&scenario().bus, Filter::default()).unwrap_err();
        assert!(error.is_bad_input());
        let sentence = error.to_string();
        for word in words {
            assert!(sentence.contains(word), "'{word}' is not in: {sentence}");
        }
    }
    assert_eq!(folder.names(), Vec::<String>::new(), "nothing is left behind");
}

/// A ring recorder that keeps a second, and its handle.
struct Ring {
    sink: Box<dyn Sink>,
    handle: SaveHandle,
}

impl Ring {
    fn start(folder: &Folder) -> Self {
        let last = Some("1s".to_owned());
        let options = RecordingOptions { record_last: last, ..to(&folder.file("run.mcap")) };
        let recording = options.create(&scenario().bus, Filter::default()).unwrap().unwrap();
        let handle = recording.save_handle().unwrap();
        let sink = recording.start().unwrap();
        assert_eq!(folder.names(), Vec::<String>::new(), "nothing is saved yet");
        Self { sink, handle }
    }

    fn hear(&mut self, messages: &[Message]) {
        for message in messages {
            self.sink.handle(message);
        }
        assert!(self.sink.refresh().unwrap());
    }

    /// Asks to save, and waits for the outcome.
    fn save(&mut self) -> SaveOutcome {
        let (sender, outcome) = mpsc::channel();
        self.handle.save("the test", move |outcome| sender.send(outcome).unwrap());
        let end = Instant::now() + Duration::from_secs(60);
        while Instant::now() < end {
            assert!(self.sink.refresh().unwrap());
            if let Ok(outcome) = outcome.recv_timeout(Duration::from_millis(5)) {
                return outcome;
            }
        }
        panic!("no outcome");
    }
}

#[test]
fn the_last_second_is_saved_on_request_in_a_file_of_its_own_each_time() {
    let folder = Folder::new();
    let mut ring = Ring::start(&folder);
    assert!(matches!(ring.save(), Err(SaveError::Nothing)));
    ring.hear(&messages(500));
    thread::sleep(Duration::from_millis(1300));
    ring.hear(&(500..600).flat_map(instant).collect::<Vec<_>>());
    let file = ring.save().unwrap();
    assert_eq!(Path::new(&file), folder.file("run-0001.mcap"));
    let saved = read(Path::new(&file));
    assert_eq!(revision(&saved[0].message), 0, "it begins with the scenario in effect");
    assert_eq!(states(&saved), (500..600).collect::<Vec<_>>(), "older ones are gone");
    assert_eq!(saved.len(), 1 + 3 * 100);

    ring.hear(&(600..610).flat_map(instant).collect::<Vec<_>>());
    let second = ring.save().unwrap();
    assert_eq!(Path::new(&second), folder.file("run-0002.mcap"));
    assert_eq!(states(&read(Path::new(&second))), (500..610).collect::<Vec<_>>());
    drop(ring);
    assert_eq!(read_parts(&folder).len(), 2, "nothing more is saved at the end");
}

#[test]
fn an_alarm_saves_what_came_before_it_and_another_one_soon_after_is_not_lost() {
    let folder = Folder::new();
    let mut ring = Ring::start(&folder);
    ring.hear(&[offered(0), state(0)]);
    let mut sequence = 0;
    let mut go_on = |ring: &mut Ring, with_controller: bool, millis: u64| {
        for _ in 0..millis / 20 {
            sequence += 1;
            ring.hear(&[state(sequence), status(sequence)]);
            if with_controller {
                ring.hear(&[torque(sequence)]);
            }
            thread::sleep(Duration::from_millis(20));
        }
        sequence
    };
    go_on(&mut ring, true, 400);
    assert_eq!(folder.names().len(), 0);
    let silent_from = go_on(&mut ring, true, 100);
    let end = go_on(&mut ring, false, 900);
    assert_eq!(folder.names(), ["run-0001.mcap"], "once, though the alarm goes on");
    let saved = states(&read(&folder.file("run-0001.mcap")));
    assert!(saved.contains(&silent_from) && *saved.last().unwrap() < end, "{saved:?}");

    // The controller comes back and falls silent again: saved when the last second is over.
    go_on(&mut ring, true, 100);
    let again = go_on(&mut ring, false, 1500);
    assert_eq!(folder.names(), ["run-0001.mcap", "run-0002.mcap"]);
    let saved = states(&read(&folder.file("run-0002.mcap")));
    assert!(saved.contains(&(end + 5)) && *saved.last().unwrap() < again, "{saved:?}");
    drop(ring);
    assert_eq!(folder.names().len(), 2);
}
