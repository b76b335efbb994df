//! Samples and scenarios on the bus itself.

use std::{
    sync::atomic::{AtomicBool, Ordering},
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::{Wait, built_in};
use mtj_protocol::{
    bus::{self, Bus, Depth, Reader},
    codec::{Offer, encode_offer},
    member::Role,
    port::{Exchange, Offered, PlantPort, fetch_scenario},
    sample::{ErrorSample, Sample, StateSample, StatusSample, TorqueSample, VERSION},
};

use crate::{Fixture, session::*};

/// The next sample, waiting for it until `until`.
fn next_of<S: Sample>(reader: &mut dyn Reader<S>, wait: Wait, until: Instant) -> Option<S> {
    bus::receive(reader, wait, until).unwrap().then(|| *reader.sample())
}

/// A stream delivers every sample once and in order; a lossy bus may leave gaps.
pub fn a_stream_keeps_order<F: Fixture>() {
    let fixture = F::new();
    let (plant, other) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut stream = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let first = connect(&mut *writer, &mut [&mut *stream]);
    for sequence in first..first + 1000 {
        writer.write(&state(sequence)).unwrap();
        if sequence % 10 == 0 {
            thread::sleep(Duration::from_millis(1));
        }
    }
    let (mut expected, last) = (first, first + 1000);
    eventually("the last one", || {
        writer.write(&state(last)).unwrap();
        while let Some(found) = next_of(&mut *stream, Wait::Block, glance()) {
            let sequence = found.header.sequence;
            if expected == last && sequence == last {
                return Some(());
            }
            let in_order = if F::LOSSY { sequence >= expected } else { sequence == expected };
            assert!(in_order, "{sequence} where {expected} was due");
            assert_eq!(found, state(sequence), "and unharmed");
            expected = (sequence + 1).min(last);
        }
        None
    });
    assert_eq!(stream.malformed(), 0);
}

/// A reader that follows a writer gets its newest sample once; a stream gets all of them after a
/// flush.
pub fn a_follower_gets_the_newest_once_and_the_stream_gets_all<F: Fixture>() {
    let fixture = F::new();
    let (plant, other) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut follower = other.reader::<StateSample>(Depth::Recent, Wait::Spin).unwrap();
    let mut stream = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let first = connect(&mut *writer, &mut [&mut *stream]);
    eventually("the writer", || follower.take().unwrap());
    for round in 0..5 {
        let last = first + 100 * round + 99;
        for sequence in last - 99..=last {
            writer.expedite(&state(sequence)).unwrap();
            thread::sleep(Duration::from_millis(1));
        }
        let mut newest = None;
        eventually("the newest", || {
            // Another process may hold the lock that `follow` needs; a port calls it with each
            // sample.
            follower.follow().unwrap();
            while let Some(found) = follower.take().unwrap() {
                assert!(newest < Some(found.header.sequence), "newer and newer");
                newest = Some(found.header.sequence);
                assert_eq!(found, state(found.header.sequence), "and unharmed");
            }
            (newest == Some(last)).then_some(())
        });
        writer.flush().unwrap();
        writer.flush().unwrap();
        let mut expected = last - 99;
        while let Some(found) = next_of(&mut *stream, Wait::Block, glance()) {
            let in_order = found.header.sequence >= expected;
            assert!(in_order && (F::LOSSY || found.header.sequence == expected), "{expected}");
            expected = found.header.sequence + 1;
        }
        assert!(F::LOSSY || expected == last + 1, "the stream ends before {expected}");
        for _ in 0..100 {
            assert_eq!(follower.take().unwrap(), None, "only once, from slot or stream");
        }
    }
}

/// A reader that follows one writer also gets the samples of the others.
pub fn a_follower_gets_the_samples_of_other_writers_too<F: Fixture>() {
    let fixture = F::new();
    let (plant, one, another) =
        (fixture.join(Role::Plant), fixture.join(Role::Controller), fixture.join(Role::Controller));
    let mut follower = plant.reader::<TorqueSample>(Depth::Recent, Wait::Spin).unwrap();
    let mut writers = [one.writer().unwrap(), another.writer().unwrap()];
    for sequence in 1..20 {
        let followed = usize::from(sequence % 5 == 0);
        for (i, writer) in writers.iter_mut().enumerate() {
            let sample = TorqueSample { controller: i as u64 + 1, ..torque(sequence) };
            eventually("a torque", || {
                writer.expedite(&sample).unwrap();
                writer.flush().unwrap();
                next_of(&mut *follower, Wait::Spin, glance()).filter(|it| *it == sample)
            });
            while follower.take().unwrap().is_some() {}
            if i == followed {
                follower.follow().unwrap();
            }
        }
    }
}

/// A reader waits neither shorter than until its deadline nor longer than until a sample comes.
pub fn a_reader_returns_at_its_deadline_or_when_a_sample_comes<F: Fixture>() {
    let fixture = F::new();
    let (plant, other) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    for (depth, wait) in [
        (Depth::Recent, Wait::Block),
        (Depth::Recent, Wait::Spin),
        (Depth::Recent, Wait::Hybrid(Duration::from_millis(1))),
        (Depth::Stream, Wait::Block),
    ] {
        let mut writer = plant.writer().unwrap();
        let mut reader = other.reader::<StateSample>(depth, wait).unwrap();
        let next = connect(&mut *writer, &mut [&mut *reader]);
        let (began, patience) = (Instant::now(), Duration::from_millis(30));
        assert_eq!(next_of(&mut *reader, wait, began + patience), None);
        assert!(began.elapsed() >= patience, "it did not give up early");
        // With a later deadline it returns when the sample comes.
        writer.write(&state(next)).unwrap();
        let found = next_of(&mut *reader, wait, deadline());
        assert_eq!(found.map(|found| found.header.sequence), Some(next));
        // With a deadline in the past it returns a sample that is there already.
        writer.write(&state(next + 1)).unwrap();
        eventually("a sample", || next_of(&mut *reader, wait, Instant::now()));
    }
}

/// A reader gets the samples of its topic and its session, and no others.
pub fn topics_and_sessions_do_not_mix<F: Fixture>() {
    let (fixture, foreign) = (F::new(), F::new());
    let (plant, other) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    let foreign_plant = foreign.join(Role::Plant);
    let mut writer = plant.writer().unwrap();
    let mut states = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let mut torques = other.reader::<TorqueSample>(Depth::Stream, Wait::Block).unwrap();
    let mut errors = other.reader::<ErrorSample>(Depth::Stream, Wait::Block).unwrap();
    let mut statuses = other.reader::<StatusSample>(Depth::Stream, Wait::Block).unwrap();
    let next = connect(&mut *writer, &mut [&mut *states]);
    foreign_plant.writer().unwrap().write(&state(1_000_000)).unwrap();
    writer.write(&state(next)).unwrap();
    let found = next_of(&mut *states, Wait::Block, deadline()).unwrap();
    assert_eq!(found.header.sequence, next, "nothing of another session");
    assert_eq!(torques.take().unwrap(), None);
    assert_eq!(errors.take().unwrap(), None);
    assert_eq!(statuses.take().unwrap(), None);
    assert_eq!(torques.malformed() + errors.malformed() + statuses.malformed(), 0);
}

/// Tells a thread to end, even where an assertion fails before it is told.
struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// A stream that is emptied fifty times a second loses nothing of ten thousand samples at 1 kHz.
pub fn a_monitor_loses_nothing_at_a_kilohertz_beside_a_loop<F: Fixture>() {
    const SAMPLES: u64 = 10_000;
    let fixture = F::new();
    let (plant, monitor) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut stream = monitor.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let (attached, over) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let (fixture, attached, over) = (&fixture, &attached, &over);
        let _end = SetOnDrop(over);
        let controller = scope.spawn(move || {
            let bus = fixture.join(Role::Controller);
            let mut latest = bus.reader::<StateSample>(Depth::Recent, Wait::Block).unwrap();
            attached.store(true, Ordering::Release);
            let (mut seen, mut newest, end) = (0, None, deadline() + Duration::from_secs(30));
            while !over.load(Ordering::Acquire) {
                assert!(Instant::now() < end, "the loop was never told to end");
                if let Some(found) = next_of(&mut *latest, Wait::Block, glance()) {
                    assert!(newest < Some(found.header.sequence), "newer and newer");
                    newest = Some(found.header.sequence);
                    seen += 1;
                }
            }
            seen
        });
        eventually("the loop's start", || attached.load(Ordering::Acquire).then_some(()));
        let first = connect(&mut *writer, &mut [&mut *stream]);
        let mut expected = first;
        let mut drain = || {
            while let Some(found) = stream.take().unwrap() {
                assert_eq!(found.header.sequence, expected, "the next one");
                expected += 1;
            }
            expected
        };
        let mut due = Instant::now();
        for k in 0..SAMPLES {
            thread::sleep(due.saturating_duration_since(Instant::now()));
            writer.write(&state(first + k)).unwrap();
            // A writer that was held up goes on at its rate: what it missed is not a burst.
            let soonest = Instant::now() + Duration::from_micros(500);
            due = (due + Duration::from_millis(1)).max(soonest);
            if k % 20 == 0 {
                drain();
            }
        }
        eventually("the last sample", || (drain() == first + SAMPLES).then_some(()));
        over.store(true, Ordering::Release);
        assert!(controller.join().unwrap() > SAMPLES / 10, "the loop took part");
    });
}

/// A scenario reaches processes that joined before the offer and after it.
pub fn early_and_late_processes_get_the_scenario<F: Fixture>() {
    let fixture = F::new();
    let (plant, early) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    assert_eq!(early.fetch().unwrap(), None, "before anything is on offer");
    let mut offering = plant.offer(b"first".to_vec()).unwrap();
    let mut fetch = |bus: &F::Bus| {
        eventually("an offer", || {
            offering.serve().unwrap();
            bus.fetch().unwrap()
        })
    };
    assert_eq!(fetch(&early), b"first");
    assert_eq!(fetch(&early), b"first", "as often as it is fetched");
    assert_eq!(fetch(&fixture.join(Role::Controller)), b"first");
}

/// An offer can be replaced, and ends when it is dropped.
pub fn an_offer_ends_with_its_plant<F: Fixture>() {
    let fixture = F::new();
    let (plant, early) = (fixture.join(Role::Plant), fixture.join(Role::Controller));
    for text in [b"first".to_vec(), vec![7; 60_000], b"third".to_vec()] {
        let mut offering = plant.offer(text.clone()).unwrap();
        eventually("the new offer", || {
            offering.serve().unwrap();
            (early.fetch().unwrap()? == text).then_some(())
        });
    }
    let late = fixture.join(Role::Controller);
    eventually("the end of the offer", || late.fetch().unwrap().is_none().then_some(()));
}

/// A role ignores offers that it cannot use, and takes the first that it can.
pub fn a_role_waits_for_a_scenario_that_it_can_read<F: Fixture>() {
    let fixture = F::new();
    let plant = fixture.join(Role::Plant);
    let text = built_in("sampled/tj").unwrap().to_owned();
    let foreign =
        Offer { version: VERSION + 1, revision: 0, run: 1, name: "sampled/tj".to_owned(), text };
    let invalid = Offer { version: VERSION, text: "seed = -1".to_owned(), ..foreign.clone() };
    let unusable = [b"garbage".to_vec(), encode_offer(&foreign), encode_offer(&invalid)];
    thread::scope(|scope| {
        let fixture = &fixture;
        let role = scope.spawn(move || {
            let end = deadline();
            fetch_scenario(&fixture.join(Role::Controller), &|| Instant::now() < end).unwrap()
        });
        for bytes in unusable {
            let mut offering = plant.offer(bytes).unwrap();
            for _ in 0..20 {
                offering.serve().unwrap();
                thread::sleep(Duration::from_millis(2));
            }
        }
        assert!(!role.is_finished(), "no unusable offer is taken");
        let mut port = PlantPort::open(&plant, &scenario(), RUN).unwrap();
        eventually("the scenario", || {
            port.report(&StatusSample { header: header(0), ..Default::default() }).unwrap();
            role.is_finished().then_some(())
        });
        let offered = Offered { run: RUN, revision: 0, scenario: scenario() };
        assert_eq!(role.join().unwrap(), Some(offered));
    });
    let end = glance();
    let empty = F::new();
    let (_plant, lonely) = (empty.join(Role::Plant), empty.join(Role::Controller));
    assert_eq!(
        fetch_scenario(&lonely, &|| Instant::now() < end).unwrap(),
        None,
        "it stops when told to"
    );
}
