use std::time::{SystemTime, UNIX_EPOCH};

use mtj_protocol::sample::{VERSION, text};

use super::*;

fn header(run: u64, time_s: u64, revision: u32) -> Header {
    let time_ns = time_s * 1_000_000_000;
    let (version, joints, axes) = (VERSION, 2, 2);
    Header { version, joints, axes, revision, run, sequence: 100 * time_s, time_ns }
}

fn state(run: u64, time_s: u64, revision: u32) -> Message {
    let header = header(run, time_s, revision);
    Message::State(StateSample { header, ..Default::default() })
}

#[test]
fn a_monitor_that_joins_late_knows_that_it_missed_changes() {
    let mut late = Overview::default();
    late.handle(&state(1, 275, 3));
    late.handle(&state(1, 276, 4));
    let joined = Joined { time_ns: 275_000_000_000, missed_changes: 3 };
    assert_eq!(late.joined(), Some(joined));
    assert_eq!(joined.words(), "monitor joined after 3 changes");
    late.handle(&state(2, 1, 4));
    assert_eq!(late.joined(), None, "it was there when the next run started");

    let mut early = Overview::default();
    early.handle(&state(1, 0, 0));
    early.handle(&state(1, 1, 0));
    assert_eq!(early.joined(), None);
}

#[test]
fn a_role_is_as_old_as_its_presence_says_and_not_as_what_was_heard_of_it() {
    let mut overview = Overview::default();
    overview.handle(&state(1, 275, 0));
    assert!(overview.plant().age().unwrap() < Duration::from_secs(1), "all that is known yet");
    let since = SystemTime::now() - Duration::from_secs(280);
    let since_ns = since.duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
    let presence = |since_ns| {
        let (header, host) = (header(1, 275, 0), text("robot"));
        let sample = PresenceSample { header, since_ns, host, ..Default::default() };
        Message::Presence(PresenceSample { role: Role::Plant as u64, ..sample })
    };
    overview.handle(&presence(since_ns));
    assert_eq!(overview.plant().age().unwrap().as_secs(), 280);
    overview.handle(&presence(u64::MAX));
    let age = overview.plant().age().unwrap();
    assert!(age < Duration::from_secs(1), "a clock that is ahead tells nothing: {age:?}");
}
