//! Another process holds the lock of the domain, as one does that is stopped while it starts.

#![cfg(feature = "iceoryx2")]
#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::{
    fs::{self, File},
    os::unix::fs::MetadataExt,
    process,
    time::{Duration, Instant},
};

use mtj_model::scenario::{BusSettings, Wait};
use mtj_protocol::{
    bus::{Bus, Depth, Reader, receive},
    member::Role,
    sample::{StateSample, VERSION},
    transport::AnyBus,
};

fn join(role: Role) -> AnyBus {
    let text = format!("kind = 'iceoryx2'\nsession = 'domain-lock-{}'", process::id());
    let settings = BusSettings::from_table("here", text.parse().unwrap()).unwrap();
    AnyBus::open(&settings, role, &|| true).unwrap().unwrap()
}

fn state(sequence: u64) -> StateSample {
    let mut state = StateSample::default();
    (state.header.version, state.header.joints, state.header.axes) = (VERSION, 2, 2);
    (state.header.run, state.header.sequence) = (1, sequence);
    state
}

fn next(reader: &mut dyn Reader<StateSample>) -> Option<u64> {
    let soon = Instant::now() + Duration::from_secs(10);
    receive(reader, Wait::Spin, soon).unwrap().then(|| reader.sample().header.sequence)
}

#[test]
fn a_loop_gets_the_samples_of_a_new_writer_while_another_process_holds_the_lock() {
    let (plant, controller) = (join(Role::Plant), join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut reader = controller.reader::<StateSample>(Depth::Recent, Wait::Spin).unwrap();
    writer.write(&state(1)).unwrap();
    assert_eq!(next(&mut *reader), Some(1));
    let user = fs::metadata("/proc/self").unwrap().uid();
    let lock = File::open(format!("/dev/shm/mtj_{user}/door")).unwrap();
    lock.lock().unwrap();
    // A reader that waited would fail after five seconds.
    reader.follow().unwrap();
    assert!(!reader.follows());
    writer.expedite(&state(2)).unwrap();
    writer.flush().unwrap();
    assert_eq!(next(&mut *reader), Some(2), "through the stream");
    lock.unlock().unwrap();
    let end = Instant::now() + Duration::from_secs(10);
    while !reader.follows() {
        assert!(Instant::now() < end, "the slot was never opened");
        reader.follow().unwrap();
    }
    writer.expedite(&state(3)).unwrap();
    assert_eq!(next(&mut *reader), Some(3), "by the slot");
    assert_eq!(reader.take().unwrap(), None, "once");
}
