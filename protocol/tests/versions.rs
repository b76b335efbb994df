//! Two versions of mtj in one session: every process warns once, in one sentence, and misreads
//! nothing.

#![cfg(all(feature = "iceoryx2", feature = "zenoh"))]
#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::{
    env,
    net::TcpListener,
    process::{self, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use ::zenoh::Wait as _;
use iceoryx2::prelude::ZeroCopySend;
use mtj_model::scenario::{BusSettings, Scenario, Wait, built_in};
use mtj_protocol::{
    bus::{Bus, Depth},
    codec::{self, LARGEST_SAMPLE, Offer},
    iceoryx2::Iceoryx2Bus,
    local::LocalBus,
    member::{Member, Role},
    port::{
        Bridge, ControllerPort, Exchange, MonitorPort, Offered, PlantPort, Traffic, fetch_scenario,
    },
    sample::{Field, FieldMut, Header, Sample, StateSample, TorqueSample, VERSION},
    transport::AnyBus,
};
use serde::{Deserialize, Serialize};
use tracing_subscriber::{
    Layer as _, filter, layer::SubscriberExt as _, util::SubscriberInitExt as _,
};

/// The version before this one, and the sizes that its samples had.
const OLD: u32 = 4;
const OLD_SIZES: [(&str, usize); 7] = [
    ("state", 320),
    ("torque", 184),
    ("error", 280),
    ("status", 280),
    ("request", 496),
    ("change", 512),
    ("presence", 144),
];

const RUN: u64 = 7;

/// A state as another version lays it out.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize, ZeroCopySend)]
#[repr(C)]
struct OtherState {
    header: Header,
    more: u64,
}

impl Sample for OtherState {
    const TOPIC: &'static str = StateSample::TOPIC;
    const ONE_WRITER: bool = true;
    const CLOSES_THE_LOOP: bool = true;

    fn header(&self) -> &Header {
        &self.header
    }
    fn is_well_formed(&self) -> bool {
        true
    }
    fn is_finite(&self) -> bool {
        true
    }
    fn fields(&self, _show: &mut dyn FnMut(&'static str, Field<'_>)) {}
    fn header_mut(&mut self) -> &mut Header {
        &mut self.header
    }
    fn field_mut(&mut self, _name: &str) -> Option<FieldMut<'_>> {
        None
    }
}

fn scenario() -> Scenario {
    Scenario::parse("sampled/mtj", built_in("sampled/mtj").unwrap(), &[]).unwrap()
}

fn controller() -> Member {
    Member { role: Role::Controller, id: 5, precedence: 0, since_ns: 1 }
}

fn offered() -> Offered {
    Offered { run: RUN, revision: 0, scenario: scenario() }
}

#[test]
fn a_process_that_joins_another_version_in_shared_memory_fails_with_a_sentence() {
    let session = format!("versions-{}", process::id());
    let (bus, other) = (Iceoryx2Bus::open(&session).unwrap(), Iceoryx2Bus::open(&session).unwrap());
    let _writer = other.writer::<OtherState>().unwrap();
    let far = LocalBus::default();
    let refused = [
        ("reader", bus.reader::<StateSample>(Depth::Recent, Wait::Block).err()),
        ("writer", bus.writer::<StateSample>().err()),
        ("plant", PlantPort::open(&bus, &scenario(), RUN).err()),
        ("controller", ControllerPort::open(&bus, &controller(), &offered(), Wait::Block).err()),
        ("monitor", MonitorPort::open(&bus).err()),
        ("bridge", Bridge::open(&bus, &far, false).err()),
        ("bridge the other way", Bridge::open(&far, &bus, false).err()),
    ];
    for (role, error) in refused {
        let Some(error) = error else { panic!("{role} has joined") };
        assert!(error.is_bad_input(), "{role}: {error:?}");
        let sentence = error.to_string();
        assert!(sentence.contains(&session) && sentence.contains("another version"), "{sentence}");
        assert!(!sentence.contains("Incompatible"), "{sentence}");
    }
}

/// For how long a role listens: longer than it waits before it says that there is no plant.
const LISTENS: Duration = Duration::from_millis(2500);

/// A role that a test starts as a process of its own, and that writes its warnings to standard
/// error.
#[test]
#[ignore = "a part of the tests below"]
fn a_role() {
    let settings = BusSettings::from_table("here", env::var("BUS").unwrap().parse().unwrap());
    let warnings = tracing_subscriber::fmt::layer().with_ansi(false).with_writer(std::io::stderr);
    let ours = filter::filter_fn(|metadata| metadata.target().starts_with("mtj_"));
    tracing_subscriber::registry().with(warnings.with_filter(ours)).init();
    let (settings, end) = (settings.unwrap(), Instant::now() + LISTENS);
    let proceed = || Instant::now() < end;
    let glance = || Instant::now() + Duration::from_millis(20);
    let join = |role| AnyBus::open(&settings, role, &proceed).unwrap().unwrap();
    match env::var("ROLE").unwrap().as_str() {
        "plant" => {
            let bus = join(Role::Plant);
            let mut port = PlantPort::open(&bus, &scenario(), RUN).unwrap();
            let header =
                Header { version: VERSION, joints: 2, axes: 2, run: RUN, ..Header::default() };
            while proceed() {
                port.send(&mut StateSample { header, ..Default::default() }).unwrap();
                assert_eq!(port.receive(glance()).unwrap(), None);
                assert_eq!(port.request().unwrap(), None);
            }
            assert!(port.rejected() > 10, "counted always: {}", port.rejected());
        }
        "controller" => {
            let bus = join(Role::Controller);
            assert_eq!(fetch_scenario(&bus, &proceed).unwrap(), None);
        }
        "controller of a plant that was replaced" => {
            let bus = join(Role::Controller);
            let mut port =
                ControllerPort::open(&bus, &controller(), &offered(), Wait::Block).unwrap();
            while proceed() {
                assert_eq!(port.receive(glance()).unwrap(), None);
            }
            assert!(port.rejected() > 10, "counted always: {}", port.rejected());
        }
        "monitor" => {
            let bus = join(Role::Monitor);
            let mut port = MonitorPort::open(&bus).unwrap();
            while proceed() {
                port.drain(&bus, &mut |message| panic!("{message:?} was misread")).unwrap();
                thread::sleep(Duration::from_millis(1));
            }
            assert!(port.rejected() > 10, "counted always: {}", port.rejected());
        }
        "bridge" => {
            let (near, far) = (join(Role::Monitor), LocalBus::default());
            let mut bridge = Bridge::open(&near, &far, false).unwrap();
            while proceed() {
                bridge.forward().unwrap();
                thread::sleep(Duration::from_millis(1));
            }
            let Traffic { forwarded, returned, malformed, .. } = bridge.traffic();
            assert_eq!((forwarded, returned), (0, 0), "nothing crosses");
            assert!(malformed > 10, "counted always: {malformed}");
            assert_eq!(far.fetch().unwrap(), None);
        }
        role => panic!("no role '{role}'"),
    }
}

/// Runs a role on a bus while `meanwhile` is repeated, and checks that it gives one warning, with
/// both versions.
fn warns_once(role: &str, bus: &str, mut meanwhile: impl FnMut()) {
    let mut child = Command::new(env::current_exe().unwrap())
        .args(["a_role", "--exact", "--ignored", "--nocapture"])
        .env("ROLE", role)
        .env("BUS", bus)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while child.try_wait().unwrap().is_none() {
        meanwhile();
        thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{role}: {said}");
    let sentences: Vec<_> = said.lines().filter(|line| line.contains(" WARN ")).collect();
    let [sentence] = sentences[..] else { panic!("{role} warns once: {said}") };
    let both = format!("protocol version {OLD}, this program has {VERSION};");
    assert!(sentence.contains(&both), "{role}: {sentence}");
}

/// A sample of the version before: the header is the same.
fn old_sample(size: usize, sequence: u64) -> Vec<u8> {
    let header =
        Header { version: OLD, joints: 2, axes: 2, run: RUN, sequence, ..Header::default() };
    let mut buffer = [0; LARGEST_SAMPLE];
    let mut bytes = codec::encode(&TorqueSample { header, ..Default::default() }, &mut buffer)
        [..size_of::<Header>()]
        .to_vec();
    bytes.resize(size, 0);
    bytes
}

fn old_offer() -> Vec<u8> {
    let text = built_in("sampled/mtj").unwrap().to_owned();
    codec::encode_offer(&Offer { version: OLD, revision: 0, run: RUN, name: "old".into(), text })
}

/// Where a session on Zenoh is, in a test of its own.
fn place(test: &str) -> (String, String) {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let (endpoint, session) =
        (format!("tcp/127.0.0.1:{port}"), format!("versions-{test}-{}", process::id()));
    (endpoint, session)
}

/// A Zenoh session for what a program of the version before would send.
fn old_session(mode: &str, end: &str, endpoint: &str) -> Option<::zenoh::Session> {
    let mut config = ::zenoh::Config::default();
    for (key, value) in [
        ("mode", format!("{mode:?}")),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
        (end, format!("[{endpoint:?}]")),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    ::zenoh::open(config).wait().ok()
}

#[test]
fn a_plant_on_zenoh_warns_once_that_a_controller_has_another_version() {
    let (endpoint, session) = place("plant");
    let bus = format!("kind = 'zenoh'\nsession = '{session}'\nlisten = '{endpoint}'");
    let mut old = None;
    let mut sequence = 0;
    warns_once("plant", &bus, || {
        if old.is_none() {
            // Until the plant listens.
            old = old_session("client", "connect/endpoints", &endpoint);
        }
        let Some(old) = &old else { return };
        for (topic, size) in [("torque", 168), ("request", 496)] {
            old.put(format!("mtj/{session}/{topic}"), old_sample(size, sequence)).wait().unwrap();
        }
        sequence += 1;
    });
}

/// A plant and a controller of the version before, to which a role of ours connects.
fn warns_once_to_an_old_loop(role: &str, test: &str) {
    let (endpoint, session) = place(test);
    let old = old_session("peer", "listen/endpoints", &endpoint).unwrap();
    let _offer = old
        .declare_queryable(format!("mtj/{session}/scenario"))
        .callback(|query| query.reply(query.key_expr(), old_offer()).wait().unwrap())
        .wait()
        .unwrap();
    let bus = format!("kind = 'zenoh'\nsession = '{session}'\nconnect = '{endpoint}'");
    let mut sequence = 0;
    warns_once(role, &bus, || {
        for (topic, size) in OLD_SIZES {
            old.put(format!("mtj/{session}/{topic}"), old_sample(size, sequence)).wait().unwrap();
        }
        sequence += 1;
    });
}

#[test]
fn a_controller_on_zenoh_warns_once_that_the_plant_has_another_version() {
    warns_once_to_an_old_loop("controller", "controller");
}

#[test]
fn a_controller_on_zenoh_warns_once_that_a_plant_was_replaced_by_one_of_another_version() {
    warns_once_to_an_old_loop("controller of a plant that was replaced", "replaced");
}

#[test]
fn a_monitor_on_zenoh_warns_once_that_the_loop_has_another_version() {
    warns_once_to_an_old_loop("monitor", "monitor");
}

#[test]
fn a_bridge_warns_once_that_the_loop_has_another_version_and_forwards_nothing() {
    warns_once_to_an_old_loop("bridge", "bridge");
}

#[test]
fn a_controller_in_shared_memory_warns_once_that_the_offer_has_another_version() {
    let session = format!("versions-offer-{}", process::id());
    let old = Iceoryx2Bus::open(&session).unwrap();
    let mut offering = old.offer(old_offer()).unwrap();
    let bus = format!("kind = 'iceoryx2'\nsession = '{session}'");
    warns_once("controller", &bus, || offering.serve().unwrap());
}
