//! What the suite is generic over, and what its properties start from.

use std::{
    net::TcpListener,
    process,
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::{Duration, Instant},
};

use ::zenoh::Wait as _;
use mtj_model::scenario::{BusSettings, Override, Scenario, Wait, built_in};
use mtj_protocol::{
    bus::{Reader, Writer, receive},
    local::LocalBus,
    member::{Member, Role},
    port::{Answer, ControllerPort, Exchange, Heard, Offered, PlantPort},
    sample::{Header, StateSample, TorqueSample, VERSION},
    transport::AnyBus,
};

/// A way to make buses of one session: what the suite is generic over.
pub trait Rig: Sync {
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

pub struct Local(LocalBus);
pub struct Iceoryx2(BusSettings);
pub struct Zenoh(BusSettings);

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

pub fn settings(text: &str) -> BusSettings {
    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let text = format!("{text}\nsession = 'conformance-{}-{count}'", process::id());
    BusSettings::from_table("here", text.parse().unwrap()).unwrap()
}

/// Nothing here takes this long unless it never comes.
pub fn soon() -> Instant {
    Instant::now() + Duration::from_secs(20)
}

/// A short look: long enough for what is there, and repeated by a caller that expects something.
pub fn glance() -> Instant {
    Instant::now() + Duration::from_millis(20)
}

/// Repeats until `attempt` has something, for a bounded time.
pub fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = soon();
    loop {
        if let Some(found) = attempt() {
            return found;
        }
        assert!(Instant::now() < end, "{what} never happened");
        thread::sleep(Duration::from_millis(1));
    }
}

/// The controller of [`close_the_loop`].
pub fn member() -> Member {
    Member { role: Role::Controller, id: 5, precedence: 0, since_ns: 1 }
}

pub const RUN: u64 = 77;

pub fn header(sequence: u64) -> Header {
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

pub fn state(sequence: u64) -> StateSample {
    StateSample { header: header(sequence), position: [0.25; 7], ..Default::default() }
}

pub fn torque(sequence: u64) -> TorqueSample {
    TorqueSample {
        header: header(sequence),
        controller: member().id,
        torque: [-1.5; 7],
        ..Default::default()
    }
}

/// Writes states until each reader has got the newest: a subscription takes a moment to reach the
/// writer. Returns the next unused sequence number.
pub fn meet(
    writer: &mut dyn Writer<StateSample>,
    readers: &mut [&mut dyn Reader<StateSample>],
) -> u64 {
    let end = soon();
    for sequence in 0.. {
        assert!(Instant::now() < end, "writer and reader never met");
        writer.write(&state(sequence)).unwrap();
        let patience = Instant::now() + Duration::from_millis(200);
        let met = readers.iter_mut().all(|reader| {
            while receive(&mut **reader, Wait::Block, patience).unwrap() {
                if reader.sample().header.sequence == sequence {
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

pub fn scenario() -> Scenario {
    let set: Override = "law.kp=31".parse().unwrap();
    Scenario::parse("sampled/mtj", built_in("sampled/mtj").unwrap(), &[set]).unwrap()
}

/// A plant's and a controller's port that have met, and somebody else in the session.
pub struct Met {
    pub plant: PlantPort,
    pub controller: ControllerPort,
    pub other: AnyBus,
    /// The next unused sequence number.
    pub next: u64,
    _buses: [AnyBus; 2],
}

pub fn close_the_loop(rig: &impl Rig) -> Met {
    let buses = [rig.join(Role::Plant), rig.join(Role::Controller)];
    let mut plant = PlantPort::open(&buses[0], &scenario(), RUN).unwrap();
    let offered = Offered { run: RUN, revision: 0, scenario: scenario() };
    let mut controller = ControllerPort::open(&buses[1], &member(), &offered, Wait::Block).unwrap();
    let mut next = 0;
    eventually("a first round trip", || {
        plant.send(&mut state(next)).unwrap();
        next += 1;
        if controller.receive(glance()).unwrap() != Some(Heard::State) {
            return None;
        }
        controller.send(&mut torque(controller.state().header.sequence)).unwrap();
        plant.receive(glance()).unwrap()
    });
    // Whatever is still under way.
    while controller.receive(glance()).unwrap().is_some() {}
    while plant.receive(glance()).unwrap().is_some() {}
    assert_eq!((plant.rejected(), controller.rejected()), (0, 0));
    Met { plant, controller, other: rig.join(Role::Controller), next, _buses: buses }
}

impl Met {
    /// Sends the next state and lets somebody answer its number; what the plant makes of that.
    pub fn answered_by(&mut self, answer: impl FnOnce(u64)) -> Option<Answer> {
        self.plant.send(&mut state(self.next)).unwrap();
        self.next += 1;
        while self.controller.receive(soon()).unwrap() != Some(Heard::State)
            || self.controller.state().header.sequence + 1 != self.next
        {}
        answer(self.next - 1);
        self.plant.receive(glance()).unwrap()
    }

    /// One sample's way around the loop.
    pub fn exchange(&mut self) {
        let sequence = self.next;
        self.next += 1;
        self.plant.send(&mut state(sequence)).unwrap();
        let heard = self.controller.receive(soon()).unwrap();
        assert_eq!(heard, Some(Heard::State), "state {sequence}");
        let sent = StateSample { leader: member().id, ..state(sequence) };
        assert_eq!(*self.controller.state(), sent);
        self.controller.send(&mut torque(sequence)).unwrap();
        assert_eq!(self.plant.receive(soon()).unwrap(), Some(Answer::Torque));
        assert_eq!(*self.plant.torque(), torque(sequence));
    }
}
