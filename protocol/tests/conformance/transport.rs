//! What moves samples and scenarios.

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
    transport::AnyBus,
};

use crate::rig::*;

/// The next sample, waiting for it until `until`.
fn next_of<S: Sample>(reader: &mut dyn Reader<S>, wait: Wait, until: Instant) -> Option<S> {
    bus::receive(reader, wait, until).unwrap().then(|| *reader.sample())
}

pub fn a_stream_keeps_order<R: Rig>() {
    let rig = R::new();
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut stream = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let first = meet(&mut *writer, &mut [&mut *stream]);
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
            let in_order = if R::DROPS { sequence >= expected } else { sequence == expected };
            assert!(in_order, "{sequence} where {expected} was due");
            assert_eq!(found, state(sequence), "and unharmed");
            expected = (sequence + 1).min(last);
        }
        None
    });
    assert_eq!(stream.malformed(), 0);
}

pub fn a_follower_gets_the_newest_once_and_the_stream_gets_all<R: Rig>() {
    let rig = R::new();
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut follower = other.reader::<StateSample>(Depth::Recent, Wait::Spin).unwrap();
    let mut stream = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let first = meet(&mut *writer, &mut [&mut *stream]);
    eventually("the writer", || follower.take().unwrap());
    for round in 0..5 {
        let last = first + 100 * round + 99;
        for sequence in last - 99..=last {
            writer.expedite(&state(sequence)).unwrap();
            thread::sleep(Duration::from_millis(1));
        }
        let mut newest = None;
        eventually("the newest", || {
            // A process that holds the lock keeps others out; a port asks with each sample.
            follower.follow().unwrap();
            while let Some(found) = follower.take().unwrap() {
                assert!(newest < Some(found.header.sequence), "newer and newer");
                newest = Some(found.header.sequence);
                assert_eq!(found, state(found.header.sequence), "and unharmed");
            }
            (newest == Some(last)).then_some(())
        });
        writer.settle().unwrap();
        writer.settle().unwrap();
        let mut expected = last - 99;
        while let Some(found) = next_of(&mut *stream, Wait::Block, glance()) {
            let in_order = found.header.sequence >= expected;
            assert!(in_order && (R::DROPS || found.header.sequence == expected), "{expected}");
            expected = found.header.sequence + 1;
        }
        assert!(R::DROPS || expected == last + 1, "the stream ends before {expected}");
        for _ in 0..100 {
            assert_eq!(follower.take().unwrap(), None, "only once, by whatever way");
        }
    }
}

pub fn whoever_follows_hears_others_too<R: Rig>() {
    let rig = R::new();
    let (plant, one, another) =
        (rig.join(Role::Plant), rig.join(Role::Controller), rig.join(Role::Controller));
    let mut follower = plant.reader::<TorqueSample>(Depth::Recent, Wait::Spin).unwrap();
    let mut writers = [one.writer().unwrap(), another.writer().unwrap()];
    for sequence in 1..20 {
        let followed = usize::from(sequence % 5 == 0);
        for (i, writer) in writers.iter_mut().enumerate() {
            let sample = TorqueSample { controller: i as u64 + 1, ..torque(sequence) };
            eventually("a torque", || {
                writer.expedite(&sample).unwrap();
                writer.settle().unwrap();
                next_of(&mut *follower, Wait::Spin, glance()).filter(|it| *it == sample)
            });
            while follower.take().unwrap().is_some() {}
            if i == followed {
                follower.follow().unwrap();
            }
        }
    }
}

pub fn a_reader_waits_as_long_as_it_is_told_and_no_longer_than_it_must<R: Rig>() {
    let rig = R::new();
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Controller));
    for (depth, wait) in [
        (Depth::Recent, Wait::Block),
        (Depth::Recent, Wait::Spin),
        (Depth::Recent, Wait::Hybrid(Duration::from_millis(1))),
        (Depth::Stream, Wait::Block),
    ] {
        let mut writer = plant.writer().unwrap();
        let mut reader = other.reader::<StateSample>(depth, wait).unwrap();
        let next = meet(&mut *writer, &mut [&mut *reader]);
        let (began, patience) = (Instant::now(), Duration::from_millis(30));
        assert_eq!(next_of(&mut *reader, wait, began + patience), None);
        assert!(began.elapsed() >= patience, "it did not give up early");
        // With all patience of the world it returns when the sample comes.
        writer.write(&state(next)).unwrap();
        let found = next_of(&mut *reader, wait, soon());
        assert_eq!(found.map(|found| found.header.sequence), Some(next));
        // The past is no time to wait for, but what is there already is had.
        writer.write(&state(next + 1)).unwrap();
        eventually("a sample", || next_of(&mut *reader, wait, Instant::now()));
    }
}

pub fn topics_and_sessions_do_not_mix<R: Rig>() {
    let (rig, foreign) = (R::new(), R::new());
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Controller));
    let foreign_plant = foreign.join(Role::Plant);
    let mut writer = plant.writer().unwrap();
    let mut states = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let mut torques = other.reader::<TorqueSample>(Depth::Stream, Wait::Block).unwrap();
    let mut errors = other.reader::<ErrorSample>(Depth::Stream, Wait::Block).unwrap();
    let mut statuses = other.reader::<StatusSample>(Depth::Stream, Wait::Block).unwrap();
    let next = meet(&mut *writer, &mut [&mut *states]);
    foreign_plant.writer().unwrap().write(&state(1_000_000)).unwrap();
    writer.write(&state(next)).unwrap();
    let found = next_of(&mut *states, Wait::Block, soon()).unwrap();
    assert_eq!(found.header.sequence, next, "nothing of another session");
    assert_eq!(torques.take().unwrap(), None);
    assert_eq!(errors.take().unwrap(), None);
    assert_eq!(statuses.take().unwrap(), None);
    assert_eq!(torques.malformed() + errors.malformed() + statuses.malformed(), 0);
}

/// Tells a thread to end, even where an assertion fails before it is told.
pub struct SetOnDrop<'a>(&'a AtomicBool);

impl Drop for SetOnDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

pub fn a_monitor_loses_nothing_at_a_kilohertz_beside_a_loop<R: Rig>() {
    const SAMPLES: u64 = 10_000;
    let rig = R::new();
    let (plant, monitor) = (rig.join(Role::Plant), rig.join(Role::Controller));
    let mut writer = plant.writer().unwrap();
    let mut stream = monitor.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let (attached, over) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let (rig, attached, over) = (&rig, &attached, &over);
        let _end = SetOnDrop(over);
        let controller = scope.spawn(move || {
            let bus = rig.join(Role::Controller);
            let mut latest = bus.reader::<StateSample>(Depth::Recent, Wait::Block).unwrap();
            attached.store(true, Ordering::Release);
            let (mut seen, mut newest, end) = (0, None, soon() + Duration::from_secs(30));
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
        let first = meet(&mut *writer, &mut [&mut *stream]);
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

pub fn a_late_joiner_gets_the_scenario_and_an_early_one_gets_it_later<R: Rig>() {
    let rig = R::new();
    let (plant, early) = (rig.join(Role::Plant), rig.join(Role::Controller));
    assert_eq!(early.fetch().unwrap(), None, "before anything is on offer");
    let mut offering = plant.offer(b"first".to_vec()).unwrap();
    let mut fetch = |bus: &AnyBus| {
        eventually("an offer", || {
            offering.serve().unwrap();
            bus.fetch().unwrap()
        })
    };
    assert_eq!(fetch(&early), b"first");
    assert_eq!(fetch(&early), b"first", "as often as one asks");
    assert_eq!(fetch(&rig.join(Role::Controller)), b"first");
}

pub fn a_scenario_is_on_offer_as_long_as_its_plant_lives<R: Rig>() {
    let rig = R::new();
    let (plant, early) = (rig.join(Role::Plant), rig.join(Role::Controller));
    for text in [b"first".to_vec(), vec![7; 60_000], b"third".to_vec()] {
        let mut offering = plant.offer(text.clone()).unwrap();
        eventually("the new offer", || {
            offering.serve().unwrap();
            (early.fetch().unwrap()? == text).then_some(())
        });
    }
    let late = rig.join(Role::Controller);
    eventually("the end of the offer", || late.fetch().unwrap().is_none().then_some(()));
}

pub fn a_role_waits_for_a_scenario_it_can_read<R: Rig>() {
    let rig = R::new();
    let plant = rig.join(Role::Plant);
    let text = built_in("sampled/tj").unwrap().to_owned();
    let foreign =
        Offer { version: VERSION + 1, revision: 0, run: 1, name: "sampled/tj".to_owned(), text };
    let refused = Offer { version: VERSION, text: "seed = -1".to_owned(), ..foreign.clone() };
    let unfit = [b"rubbish".to_vec(), encode_offer(&foreign), encode_offer(&refused)];
    thread::scope(|scope| {
        let rig = &rig;
        let role = scope.spawn(move || {
            let end = soon();
            fetch_scenario(&rig.join(Role::Controller), &|| Instant::now() < end).unwrap()
        });
        for bytes in unfit {
            let mut offering = plant.offer(bytes).unwrap();
            for _ in 0..20 {
                offering.serve().unwrap();
                thread::sleep(Duration::from_millis(2));
            }
        }
        assert!(!role.is_finished(), "nothing unfit is taken");
        let mut port = PlantPort::open(&plant, &scenario(), RUN).unwrap();
        eventually("the scenario", || {
            port.report(&StatusSample { header: header(0), ..Default::default() }).unwrap();
            role.is_finished().then_some(())
        });
        let offered = Offered { run: RUN, revision: 0, scenario: scenario() };
        assert_eq!(role.join().unwrap(), Some(offered));
    });
    let end = glance();
    let bus = R::new();
    let (_plant, lonely) = (bus.join(Role::Plant), bus.join(Role::Controller));
    assert_eq!(fetch_scenario(&lonely, &|| Instant::now() < end).unwrap(), None, "told to give up");
}
