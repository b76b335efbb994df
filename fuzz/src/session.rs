//! A conversation as monitors hear it, and as they record it.

use std::{
    cell::RefCell,
    fs,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use mtj_model::scenario::Scenario;
use mtj_monitor::{
    monitor::Sink,
    overview::Overview,
    recording::{Recording, TOPICS, Timeline, Topic, read_json, write_json},
    web::WebDashboard,
};
use mtj_protocol::{
    admission, codec,
    port::{Message, Offered},
    request::Request,
    sample::{Sample, VERSION},
};

/// Whatever is said in a session, every display can show it. A message is a byte that chooses the
/// topic and the bytes of the sample, with the version filled in; what is missing of the last one
/// is zero.
pub fn session(data: &[u8]) {
    let mut overview = Overview::default();
    let mut timeline = Timeline::default();
    let mut dashboard = WebDashboard::detached();
    let mut rest = data;
    while let Some((topic, bytes)) = rest.split_first() {
        let (message, used) = match TOPICS[usize::from(*topic) % TOPICS.len()] {
            Topic::Scenario => scenario(bytes),
            Topic::State => sample(bytes, Message::State),
            Topic::Torque => sample(bytes, Message::Torque),
            Topic::Error => sample(bytes, Message::Error),
            Topic::Status => sample(bytes, Message::Status),
            Topic::Request => sample(bytes, Message::Request),
            Topic::Change => sample(bytes, Message::Change),
            Topic::Presence => sample(bytes, Message::Presence),
        };
        rest = &bytes[used..];
        let Some(message) = message else { continue };
        if !matches!(message, Message::Scenario(_)) {
            same_in_json(&message);
        }
        overview.handle(&message);
        timeline.log_time(&message, 1 << 60);
        dashboard.handle(&message);
        let _ = (overview.time(), overview.law(), overview.alarm(), overview.phase());
        match message {
            Message::Change(change) => drop(change.words()),
            Message::Request(request) => drop(Request::from_sample(&request)),
            _ => {}
        }
    }
}

fn sample<S: Sample>(bytes: &[u8], message: fn(S) -> Message) -> (Option<Message>, usize) {
    let used = size_of::<S>().min(bytes.len());
    let mut whole = [0; codec::LARGEST_SAMPLE];
    whole[..used].copy_from_slice(&bytes[..used]);
    whole[..4].copy_from_slice(&VERSION.to_le_bytes());
    let sample = codec::decode::<S>(&whole[..size_of::<S>()]);
    (sample.filter(|sample| admission::check(sample).is_ok()).map(message), used)
}

/// A built-in scenario of a run that the bytes name.
fn scenario(bytes: &[u8]) -> (Option<Message>, usize) {
    let Some((number, _)) = bytes.split_first_chunk::<9>() else { return (None, bytes.len()) };
    let (run, revision) = number.split_at(8);
    static SCENARIO: OnceLock<Option<Scenario>> = OnceLock::new();
    let scenario = SCENARIO.get_or_init(|| Scenario::load("sampled/mtj", &[]).ok());
    let run = run.try_into().map_or(0, u64::from_le_bytes);
    let revision = u32::from(revision[0]);
    let offered = scenario.clone().map(|scenario| Arc::new(Offered { run, revision, scenario }));
    (offered.map(Message::Scenario), 9)
}

/// A recording is read to its end, or refused in words; what was read from it is written and read
/// the same. Bytes that do not begin as MCAP does are a topic and its JSON.
pub fn recording(data: &[u8]) {
    if !data.starts_with(b"\x89MCAP") {
        let Some((topic, json)) = data.split_first() else { return };
        if let Ok(message) = read_json(TOPICS[usize::from(*topic) % TOPICS.len()], json) {
            same_in_json(&message);
        }
        return;
    }
    with_file(data, |path| {
        if let Ok(messages) = Recording::open(path) {
            messages.take(10_000).map_while(Result::ok).for_each(|it| same_in_json(&it.message));
        }
    });
}

fn same_in_json(message: &Message) {
    let (mut json, mut again) = (Vec::new(), Vec::new());
    let read = write_json(&mut json, message)
        .map_err(|error| error.to_string())
        .and_then(|()| read_json(Topic::of(message), &json).map_err(|error| error.to_string()));
    match read.map(|read| write_json(&mut again, &read)) {
        Ok(Ok(())) => assert_eq!(json, again),
        other => panic!("{message:?} is not read back: {other:?}"),
    }
}

/// Calls `read` with the path of a file that holds `data`, one for each thread.
pub(crate) fn with_file(data: &[u8], read: impl FnOnce(&Path)) {
    thread_local! {
        static FILE: RefCell<Option<Scratch>> = const { RefCell::new(None) };
    }
    FILE.with_borrow_mut(|file| {
        let file = file.get_or_insert_with(Scratch::new);
        if fs::write(&file.0, data).is_ok() {
            read(&file.0);
        }
    });
}

/// A file's path; the file goes when this does.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> Self {
        let shared_memory = Path::new("/dev/shm");
        let folder =
            if shared_memory.is_dir() { shared_memory.to_owned() } else { std::env::temp_dir() };
        let thread = format!("{:?}", std::thread::current().id());
        Self(folder.join(format!("mtj-fuzz-{}-{thread}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}
