//! What every bus must do, written once and run over each of them.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::{
    net::TcpListener,
    process,
    sync::atomic::{AtomicBool, AtomicU64, Ordering},
    thread,
    time::{Duration, Instant},
};

use ::zenoh::Wait as _;
use mtj_model::scenario::{BusSettings, Override, Scenario, Wait, built_in};
use mtj_protocol::{
    bus::{Bus, Depth, Reader, Role, Writer, receive},
    codec::{Offer, encode_offer},
    local::LocalBus,
    port::{
        Answer, ControllerPort, Exchange, Heard, Message, MonitorPort, PlantPort, fetch_scenario,
    },
    sample::{ErrorSample, Header, Sample, StateSample, StatusSample, TorqueSample, VERSION},
    transport::AnyBus,
};

/// A way to make buses of one session: what the suite is generic over.
trait Rig: Sync {
    /// Whether a burst may have gaps, because what congests the way is dropped rather than queued.
    const DROPS: bool = false;
    /// A session that no other test has.
    fn new() -> Self;
    /// Joins the session. The plant joins once, before all others.
    fn join(&self, role: Role) -> AnyBus;
    /// Puts bytes that are no sample on a topic; false where the transport lets nobody do so.
    fn put_rubbish(&self, _topic: &str, _rubbish: &[u8]) -> bool {
        false
    }
}

struct Local(LocalBus);
struct Iceoryx2(BusSettings);
struct Zenoh(BusSettings);

impl Rig for Local {
    fn new() -> Self {
        Self(LocalBus::default())
    }
    fn join(&self, _role: Role) -> AnyBus {
        AnyBus::Local(self.0.clone())
    }
}

impl Rig for Iceoryx2 {
    fn new() -> Self {
        Self(settings("kind = 'iceoryx2'"))
    }
    fn join(&self, role: Role) -> AnyBus {
        AnyBus::open(&self.0, role, &|| true).unwrap().unwrap()
    }
}

impl Rig for Zenoh {
    const DROPS: bool = true;
    fn new() -> Self {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        Self(settings(&format!("kind = 'zenoh'\nlisten = 'tcp/127.0.0.1:{port}'")))
    }
    fn join(&self, role: Role) -> AnyBus {
        AnyBus::open(&self.0, role, &|| true).unwrap().unwrap()
    }
    fn put_rubbish(&self, topic: &str, rubbish: &[u8]) -> bool {
        let mut config = ::zenoh::Config::default();
        let endpoints = format!("{:?}", self.0.connect_endpoints());
        for (key, value) in [
            ("mode", "\"client\""),
            ("scouting/multicast/enabled", "false"),
            ("connect/endpoints", &endpoints),
        ] {
            config.insert_json5(key, value).unwrap();
        }
        let session = ::zenoh::open(config).wait().unwrap();
        session.put(format!("mtj/{}/{topic}", self.0.session), rubbish).wait().unwrap();
        session.close().wait().unwrap();
        true
    }
}

fn settings(text: &str) -> BusSettings {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let text = format!("{text}\nsession = 'conformance-{}-{count}'", process::id());
    BusSettings::from_table("here", text.parse().unwrap()).unwrap()
}

macro_rules! for_every_bus {
    ($($property:ident;)*) => {
        mod local { $(#[test] fn $property() { super::$property::<super::Local>(); })* }
        mod iceoryx2 { $(#[test] fn $property() { super::$property::<super::Iceoryx2>(); })* }
        mod zenoh { $(#[test] fn $property() { super::$property::<super::Zenoh>(); })* }
    };
}

for_every_bus! {
    a_stream_keeps_order;
    the_latest_value_wins_and_is_read_once;
    a_reader_waits_as_long_as_it_is_told_and_no_longer_than_it_must;
    topics_and_sessions_do_not_mix;
    a_monitor_loses_nothing_at_a_kilohertz_beside_a_loop;
    a_late_joiner_gets_the_scenario_and_an_early_one_gets_it_later;
    a_scenario_is_on_offer_as_long_as_its_plant_lives;
    a_role_waits_for_a_scenario_it_can_read;
    the_loop_closes_through_the_ports;
    the_plant_ignores_torques_that_are_not_acceptable;
    the_controller_ignores_states_that_are_not_acceptable;
    the_controller_is_asked_again_and_notices_another_run;
    a_monitor_hears_everything_acceptable;
    rubbish_is_counted_and_the_loop_goes_on;
}

/// Nothing here takes this long unless it never comes.
fn soon() -> Instant {
    Instant::now() + Duration::from_secs(20)
}

/// A short look: long enough for what is there, and repeated by whoever expects something.
fn glance() -> Instant {
    Instant::now() + Duration::from_millis(20)
}

/// Repeats until `attempt` has something, for a bounded time.
fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = soon();
    loop {
        if let Some(found) = attempt() {
            return found;
        }
        assert!(Instant::now() < end, "{what} never happened");
        thread::sleep(Duration::from_millis(1));
    }
}

const RUN: u64 = 77;

fn header(sequence: u64) -> Header {
    let time_ns = sequence.wrapping_mul(1_000_000);
    Header {
        version: VERSION,
        joints: 2,
        axes: 2,
        run: RUN,
        sequence,
        time_ns,
        ..Header::default()
    }
}

fn state(sequence: u64) -> StateSample {
    StateSample { header: header(sequence), position: [0.25; 7], ..Default::default() }
}

fn torque(sequence: u64) -> TorqueSample {
    TorqueSample { header: header(sequence), torque: [-1.5; 7], ..Default::default() }
}

/// Writes states until each reader has got the newest: a subscription takes a moment to reach the
/// writer. Returns the next unused sequence number.
fn meet(writer: &mut dyn Writer<StateSample>, readers: &mut [&mut dyn Reader<StateSample>]) -> u64 {
    let end = soon();
    for sequence in 0.. {
        assert!(Instant::now() < end, "writer and reader never met");
        writer.write(&state(sequence)).unwrap();
        let patience = Instant::now() + Duration::from_millis(200);
        let met = readers.iter_mut().all(|reader| {
            while let Some(found) = receive(&mut **reader, Wait::Block, patience).unwrap() {
                if found.header.sequence == sequence {
                    return true;
                }
            }
            false
        });
        if met {
            return sequence + 1;
        }
    }
    unreachable!("the numbers end later than the patience")
}

fn a_stream_keeps_order<R: Rig>() {
    let rig = R::new();
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Other));
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
        while let Some(found) = receive(&mut *stream, Wait::Block, glance()).unwrap() {
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

fn the_latest_value_wins_and_is_read_once<R: Rig>() {
    let rig = R::new();
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Other));
    let mut writer = plant.writer().unwrap();
    let mut latest = other.reader::<StateSample>(Depth::Latest, Wait::Spin).unwrap();
    let mut stream = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let first = meet(&mut *writer, &mut [&mut *latest, &mut *stream]);
    for round in 0..5 {
        let last = first + 100 * round + 99;
        for sequence in last - 99..=last {
            writer.write(&state(sequence)).unwrap();
            thread::sleep(Duration::from_millis(1));
        }
        // When the stream has the last one, so has the process; its other reader is a moment away.
        while receive(&mut *stream, Wait::Block, soon()).unwrap().unwrap().header.sequence != last {
        }
        thread::sleep(Duration::from_millis(50));
        assert_eq!(latest.take().unwrap().map(|found| found.header.sequence), Some(last));
        assert_eq!(latest.take().unwrap(), None, "only once");
    }
}

fn a_reader_waits_as_long_as_it_is_told_and_no_longer_than_it_must<R: Rig>() {
    let rig = R::new();
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Other));
    for (depth, wait) in
        [(Depth::Latest, Wait::Block), (Depth::Latest, Wait::Spin), (Depth::Stream, Wait::Block)]
    {
        let mut writer = plant.writer().unwrap();
        let mut reader = other.reader::<StateSample>(depth, wait).unwrap();
        let next = meet(&mut *writer, &mut [&mut *reader]);
        let (began, patience) = (Instant::now(), Duration::from_millis(30));
        assert_eq!(receive(&mut *reader, wait, began + patience).unwrap(), None);
        assert!(began.elapsed() >= patience, "it did not give up early");
        // With all patience of the world it returns when the sample comes.
        writer.write(&state(next)).unwrap();
        let found = receive(&mut *reader, wait, soon()).unwrap();
        assert_eq!(found.map(|found| found.header.sequence), Some(next));
        // The past is no time to wait for, but what is there already is had.
        writer.write(&state(next + 1)).unwrap();
        eventually("a sample", || receive(&mut *reader, wait, Instant::now()).unwrap());
    }
}

fn topics_and_sessions_do_not_mix<R: Rig>() {
    let (rig, foreign) = (R::new(), R::new());
    let (plant, other) = (rig.join(Role::Plant), rig.join(Role::Other));
    let foreign_plant = foreign.join(Role::Plant);
    let mut writer = plant.writer().unwrap();
    let mut states = other.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let mut torques = other.reader::<TorqueSample>(Depth::Stream, Wait::Block).unwrap();
    let mut errors = other.reader::<ErrorSample>(Depth::Stream, Wait::Block).unwrap();
    let mut statuses = other.reader::<StatusSample>(Depth::Stream, Wait::Block).unwrap();
    let next = meet(&mut *writer, &mut [&mut *states]);
    foreign_plant.writer().unwrap().write(&state(1_000_000)).unwrap();
    writer.write(&state(next)).unwrap();
    let found = receive(&mut *states, Wait::Block, soon()).unwrap().unwrap();
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

fn a_monitor_loses_nothing_at_a_kilohertz_beside_a_loop<R: Rig>() {
    const SAMPLES: u64 = 10_000;
    let rig = R::new();
    let (plant, monitor) = (rig.join(Role::Plant), rig.join(Role::Other));
    let mut writer = plant.writer().unwrap();
    let mut stream = monitor.reader::<StateSample>(Depth::Stream, Wait::Block).unwrap();
    let (attached, over) = (AtomicBool::new(false), AtomicBool::new(false));
    thread::scope(|scope| {
        let (rig, attached, over) = (&rig, &attached, &over);
        let _end = SetOnDrop(over);
        let controller = scope.spawn(move || {
            let bus = rig.join(Role::Other);
            let mut latest = bus.reader::<StateSample>(Depth::Latest, Wait::Block).unwrap();
            attached.store(true, Ordering::Release);
            let (mut seen, mut newest, end) = (0, None, soon() + Duration::from_secs(30));
            while !over.load(Ordering::Acquire) {
                assert!(Instant::now() < end, "the loop was never told to end");
                if let Some(found) = receive(&mut *latest, Wait::Block, glance()).unwrap() {
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

fn a_late_joiner_gets_the_scenario_and_an_early_one_gets_it_later<R: Rig>() {
    let rig = R::new();
    let (plant, early) = (rig.join(Role::Plant), rig.join(Role::Other));
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
    assert_eq!(fetch(&rig.join(Role::Other)), b"first");
}

fn a_scenario_is_on_offer_as_long_as_its_plant_lives<R: Rig>() {
    let rig = R::new();
    let (plant, early) = (rig.join(Role::Plant), rig.join(Role::Other));
    for text in [b"first".to_vec(), vec![7; 60_000], b"third".to_vec()] {
        let mut offering = plant.offer(text.clone()).unwrap();
        eventually("the new offer", || {
            offering.serve().unwrap();
            (early.fetch().unwrap()? == text).then_some(())
        });
    }
    let late = rig.join(Role::Other);
    eventually("the end of the offer", || late.fetch().unwrap().is_none().then_some(()));
}

fn a_role_waits_for_a_scenario_it_can_read<R: Rig>() {
    let rig = R::new();
    let plant = rig.join(Role::Plant);
    let text = built_in("sampled/tj").unwrap().to_owned();
    let foreign = Offer { version: VERSION + 1, run: 1, name: "sampled/tj".to_owned(), text };
    let refused = Offer { version: VERSION, text: "seed = -1".to_owned(), ..foreign.clone() };
    let unfit = [b"rubbish".to_vec(), encode_offer(&foreign), encode_offer(&refused)];
    thread::scope(|scope| {
        let rig = &rig;
        let role = scope.spawn(move || {
            let end = soon();
            fetch_scenario(&rig.join(Role::Other), &|| Instant::now() < end).unwrap()
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
        assert_eq!(role.join().unwrap(), Some((RUN, scenario())));
    });
    let end = glance();
    let bus = R::new();
    let (_plant, lonely) = (bus.join(Role::Plant), bus.join(Role::Other));
    assert_eq!(fetch_scenario(&lonely, &|| Instant::now() < end).unwrap(), None, "told to give up");
}

fn scenario() -> Scenario {
    let set: Override = "law.kp=31".parse().unwrap();
    Scenario::parse("sampled/mtj", built_in("sampled/mtj").unwrap(), &[set]).unwrap()
}

/// A plant's and a controller's port that have met, and somebody else in the session.
struct Met {
    plant: PlantPort,
    controller: ControllerPort,
    other: AnyBus,
    /// The next unused sequence number.
    next: u64,
    _buses: [AnyBus; 2],
}

fn close_the_loop(rig: &impl Rig) -> Met {
    let buses = [rig.join(Role::Plant), rig.join(Role::Other)];
    let mut plant = PlantPort::open(&buses[0], &scenario(), RUN).unwrap();
    let mut controller = ControllerPort::open(&buses[1], RUN, Wait::Block).unwrap();
    let mut next = 0;
    eventually("a first round trip", || {
        plant.send(&state(next)).unwrap();
        next += 1;
        let Heard::State(heard) = controller.receive(glance()).unwrap()? else { return None };
        controller.send(&torque(heard.header.sequence)).unwrap();
        plant.receive(glance()).unwrap()
    });
    // Whatever is still under way.
    while controller.receive(glance()).unwrap().is_some() {}
    while plant.receive(glance()).unwrap().is_some() {}
    assert_eq!((plant.rejected(), controller.rejected()), (0, 0));
    Met { plant, controller, other: rig.join(Role::Other), next, _buses: buses }
}

impl Met {
    /// One sample's way around the loop.
    fn exchange(&mut self) {
        let sequence = self.next;
        self.next += 1;
        self.plant.send(&state(sequence)).unwrap();
        match self.controller.receive(soon()).unwrap() {
            Some(Heard::State(heard)) => assert_eq!(heard, state(sequence)),
            _ => panic!("the controller did not hear state {sequence}"),
        }
        self.controller.send(&torque(sequence)).unwrap();
        let answer = self.plant.receive(soon()).unwrap();
        assert_eq!(answer, Some(Answer::Torque(torque(sequence))));
    }
}

fn the_loop_closes_through_the_ports<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    for _ in 0..300 {
        met.exchange();
    }
    assert_eq!((met.plant.rejected(), met.controller.rejected()), (0, 0));
}

/// Samples that are unacceptable for one reason each.
fn faults<S: Sample>(
    good: impl Fn(u64) -> S,
    header_of: fn(&mut S) -> &mut Header,
    number_of: fn(&mut S) -> &mut f64,
) -> Vec<(&'static str, S)> {
    let with = |change: &dyn Fn(&mut S)| {
        let mut sample = good(1 << 40);
        change(&mut sample);
        sample
    };
    vec![
        ("foreign version", with(&|s| header_of(s).version = VERSION + 1)),
        ("no joints", with(&|s| header_of(s).joints = 0)),
        ("eight joints", with(&|s| header_of(s).joints = 8)),
        ("no axes", with(&|s| header_of(s).axes = 0)),
        ("seven axes", with(&|s| header_of(s).axes = 7)),
        ("foreign run", with(&|s| header_of(s).run = RUN + 1)),
        ("not a number", with(&|s| *number_of(s) = f64::NAN)),
        ("infinite", with(&|s| *number_of(s) = f64::NEG_INFINITY)),
        ("stale", with(&|s| *header_of(s) = header(0))),
    ]
}

fn the_plant_ignores_torques_that_are_not_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut stranger = met.other.writer::<TorqueSample>().unwrap();
    eventually("a good torque of a stranger", || {
        met.next += 1;
        stranger.write(&torque(met.next)).unwrap();
        met.plant.receive(glance()).unwrap()
    });
    while met.plant.receive(glance()).unwrap().is_some() {}
    met.next += 1;
    let faults = faults(torque, |s| &mut s.header, |s| &mut s.torque[6]);
    for (count, (name, bad)) in faults.into_iter().enumerate() {
        stranger.write(&bad).unwrap();
        eventually(name, || {
            match met.plant.receive(glance()).unwrap() {
                None => {}
                Some(Answer::NotFinite(sequence)) => {
                    assert_eq!((sequence, bad.torque[6].is_finite()), (1 << 40, false));
                }
                Some(Answer::Torque(found)) => panic!("{name} came through: {found:?}"),
            }
            (met.plant.rejected() == count as u64 + 1).then_some(())
        });
        met.exchange();
        // A duplicate of the newest acts only once.
        stranger.write(&torque(met.next - 1)).unwrap();
        assert_eq!(met.plant.receive(glance()).unwrap(), None, "a duplicate after {name}");
        met.exchange();
        assert_eq!(met.plant.rejected(), count as u64 + 1, "after {name}");
    }
}

fn the_controller_ignores_states_that_are_not_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    met.exchange();
    let faults = faults(state, |s| &mut s.header, |s| &mut s.delivered[0]);
    for (count, (name, bad)) in faults.into_iter().enumerate() {
        met.plant.send(&bad).unwrap();
        eventually(name, || {
            match met.controller.receive(glance()).unwrap() {
                None => {}
                Some(Heard::OtherRun(run)) => assert_eq!((run, name), (RUN + 1, "foreign run")),
                Some(_) => panic!("{name} came through"),
            }
            (met.controller.rejected() == count as u64 + 1).then_some(())
        });
        met.exchange();
    }
}

fn the_controller_is_asked_again_and_notices_another_run<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    met.exchange();
    let repeated = StateSample { sent_ns: 99, ..state(met.next - 1) };
    met.plant.send(&repeated).unwrap();
    match met.controller.receive(soon()).unwrap() {
        Some(Heard::Again(found)) => assert_eq!(found, repeated),
        _ => panic!("a repeated state asks for the same answer again"),
    }
    assert_eq!(met.controller.rejected(), 0, "asking again is no fault");
    let mut restarted = state(0);
    restarted.header.run = RUN + 1;
    met.plant.send(&restarted).unwrap();
    match met.controller.receive(soon()).unwrap() {
        Some(Heard::OtherRun(run)) => assert_eq!(run, RUN + 1),
        _ => panic!("a state of another run says so"),
    }
}

/// Makes a monitor that all four topics of a session reach.
fn monitor(met: &mut Met) -> MonitorPort {
    let mut monitor = MonitorPort::open(&met.other).unwrap();
    let mut reached = [false; 4];
    eventually("all four topics", || {
        met.exchange();
        let header = header(met.next);
        met.plant.report(&StatusSample { header, ..Default::default() }).unwrap();
        met.controller.publish(&ErrorSample { header, ..Default::default() }).unwrap();
        monitor
            .drain(|message| {
                let topic = match message {
                    Message::State(_) => 0,
                    Message::Torque(_) => 1,
                    Message::Error(_) => 2,
                    Message::Status(_) => 3,
                };
                reached[topic] = true;
            })
            .unwrap();
        (reached == [true; 4]).then_some(())
    });
    monitor
}

fn a_monitor_hears_everything_acceptable<R: Rig>() {
    let mut met = close_the_loop(&R::new());
    let mut monitor = monitor(&mut met);
    let first = met.next;
    for _ in 0..100 {
        met.exchange();
    }
    let mut foreign = torque(met.next);
    foreign.header.version = VERSION + 1;
    met.controller.send(&foreign).unwrap();
    let (mut states, mut torques) = (Vec::new(), Vec::new());
    eventually("the refusal", || {
        monitor
            .drain(|message| match message {
                Message::State(state) => states.push(state.header.sequence),
                Message::Torque(torque) => torques.push(torque.header.sequence),
                _ => {}
            })
            .unwrap();
        (monitor.rejected() == 1 && states.last() == Some(&(met.next - 1))).then_some(())
    });
    let expected: Vec<_> = (first..met.next).collect();
    for mut heard in [states, torques] {
        heard.retain(|sequence| *sequence >= first);
        assert_eq!(heard, expected);
    }
}

fn rubbish_is_counted_and_the_loop_goes_on<R: Rig>() {
    let rig = R::new();
    let mut met = close_the_loop(&rig);
    let mut monitor = monitor(&mut met);
    let sample = [0; size_of::<TorqueSample>()];
    let (short, long) = (&sample[1..], [&sample[..], &[0]].concat());
    // Bytes of the right length are a sample, but one of version 0, which is nobody's.
    let kinds: [&[u8]; 6] = [b"", b"rubbish", &[0xff; 100_000], short, &long, &sample];
    for (count, rubbish) in kinds.iter().enumerate() {
        if !rig.put_rubbish("torque", rubbish) {
            return; // Shared memory is typed, and so is a process.
        }
        eventually("the plant's count", || {
            assert_eq!(met.plant.receive(glance()).unwrap(), None);
            (met.plant.rejected() == count as u64 + 1).then_some(())
        });
    }
    for rubbish in &kinds[..5] {
        assert!(rig.put_rubbish("state", rubbish));
    }
    eventually("the controller's count", || {
        assert!(met.controller.receive(glance()).unwrap().is_none());
        (met.controller.rejected() == 5).then_some(())
    });
    eventually("the monitor's count", || {
        monitor.drain(|_| {}).unwrap();
        (monitor.rejected() == 11).then_some(())
    });
    for _ in 0..20 {
        met.exchange();
    }
}
