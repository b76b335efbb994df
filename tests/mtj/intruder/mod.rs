//! An intruder: somebody on a plant's network who speaks its protocol as well as a controller does,
//! shows whatever certificate it has got hold of, and says all that it is not asked.

use std::{
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use mtj_protocol::{
    codec::{self, LARGEST_SAMPLE},
    member::{Member, Role},
    request::Request,
    sample::{PresenceSample, Sample, StateSample, StatusSample, TorqueSample},
    zenoh::threads,
};
use zenoh::{Config, Session, Wait, handlers::RingChannel};

/// What a process proves itself with: the authority it trusts, its certificate and the key.
pub struct Papers<'a> {
    pub authority: &'a Path,
    pub own: Option<(&'a Path, &'a Path)>,
}

/// A raw Zenoh session with a listener; fails if the two do not trust each other.
pub fn connect(endpoint: &str, papers: &Papers<'_>) -> zenoh::Result<Session> {
    let mut config = Config::default();
    let path = |path: &Path| format!("{:?}", path.display().to_string());
    let mut set = |key: &str, value: &str| config.insert_json5(key, value).unwrap();
    set("mode", "\"client\"");
    set("scouting/multicast/enabled", "false");
    set("listen/endpoints", "[]");
    set("connect/endpoints", &format!("[{endpoint:?}]"));
    set("transport/link/tls/root_ca_certificate", &path(papers.authority));
    if let Some((certificate, key)) = papers.own {
        set("transport/link/tls/enable_mtls", "true");
        set("transport/link/tls/connect_certificate", &path(certificate));
        set("transport/link/tls/connect_private_key", &path(key));
    }
    threads::use_one_thread();
    zenoh::open(config).wait()
}

/// What an intruder found out.
#[derive(Debug, Default)]
pub struct Heard {
    pub states: usize,
    pub statuses: usize,
    /// The latest sampling instant.
    pub newest: u64,
}

/// What an intruder says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Say {
    /// A torque for every state, well formed.
    Torque,
    /// Requests to kick the arm, and to loosen its gains.
    Request,
    /// States that are not so, and the statuses to them.
    State,
    /// That it is a plant, and a controller that goes before all others.
    Presence,
    /// A scenario of its own to anybody that asks for one.
    Scenario,
    /// Everything at once, under keys that stand for many, and that all of it is gone.
    Everything,
}

/// An intruder at work.
pub struct Intruder {
    stop: Arc<AtomicBool>,
    work: JoinHandle<Heard>,
}

impl Intruder {
    /// Hears what is said in a session, and says all this at every state.
    pub fn begin(bus: Session, session: &str, says: &[Say]) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (until, prefix, says) = (Arc::clone(&stop), format!("mtj/{session}"), says.to_vec());
        Self { stop, work: thread::spawn(move || work(&bus, &prefix, &says, &until)) }
    }

    /// Leaves, and tells.
    pub fn end(self) -> Heard {
        self.stop.store(true, Ordering::Relaxed);
        self.work.join().unwrap()
    }
}

fn work(bus: &Session, prefix: &str, says: &[Say], stop: &AtomicBool) -> Heard {
    let key = |topic: &str| format!("{prefix}/{topic}");
    // What it has no time for is dropped: a channel that fills up would hold Zenoh's own thread.
    let hear =
        |topic| bus.declare_subscriber(key(topic)).with(RingChannel::new(4096)).wait().unwrap();
    let (states, statuses) = (hear("state"), hear("status"));
    let _scenario = says.contains(&Say::Scenario).then(|| {
        let reply = |query: zenoh::query::Query| {
            let _ = query.reply(query.key_expr(), b"torque = \"all of it\"".to_vec()).wait();
        };
        bus.declare_queryable(key("scenario")).callback(reply).wait().unwrap()
    });
    let _members: Vec<_> = [Role::Plant, Role::Controller]
        .into_iter()
        .filter(|_| says.contains(&Say::Presence))
        .map(|role| key(&format!("member/{}", Member::new(role, u32::MAX))))
        .map(|key| bus.liveliness().declare_token(key).wait().unwrap())
        .collect();
    let mut heard = Heard::default();
    while !stop.load(Ordering::Relaxed) {
        while let Ok(Some(sample)) = statuses.try_recv() {
            heard.statuses +=
                usize::from(codec::decode::<StatusSample>(&sample.payload().to_bytes()).is_some());
        }
        let Ok(Some(sample)) = states.recv_timeout(Duration::from_millis(5)) else { continue };
        let Some(state) = codec::decode::<StateSample>(&sample.payload().to_bytes()) else {
            continue;
        };
        heard.states += 1;
        heard.newest = heard.newest.max(state.header.sequence);
        for say in says {
            speak(bus, prefix, *say, &state);
        }
    }
    heard
}

fn speak(bus: &Session, prefix: &str, say: Say, state: &StateSample) {
    let mut torque = TorqueSample {
        header: state.header,
        state_sent_ns: state.sent_ns,
        residence_ns: 1,
        controller: state.leader.max(1),
        ..TorqueSample::default()
    };
    torque.torque[..2].copy_from_slice(&[9.0, -9.0]);
    match say {
        Say::Torque => put(bus, prefix, &torque),
        Say::Request => {
            let number = state.sent_ns;
            let kick = Request::Kick { torque: vec![9.0, -9.0], milliseconds: 100.0 };
            put(bus, prefix, &kick.to_sample(state.header.run, number));
            let set = Request::Set(vec!["law.kp=1".to_owned()]);
            put(bus, prefix, &set.to_sample(state.header.run, number + 1));
        }
        Say::State => {
            let mut false_state = *state;
            false_state.header.sequence += 1;
            false_state.position[0] += 0.5;
            put(bus, prefix, &false_state);
            put(
                bus,
                prefix,
                &StatusSample { header: state.header, phase: 2, ..Default::default() },
            );
        }
        Say::Presence => {
            put(bus, prefix, &PresenceSample { header: state.header, ..Default::default() });
        }
        Say::Scenario => {}
        Say::Everything => {
            let mut buffer = [0; LARGEST_SAMPLE];
            let bytes = codec::encode(&torque, &mut buffer).to_vec();
            for key in [format!("{prefix}/*"), format!("{prefix}/**"), "mtj/*/torque".to_owned()] {
                let _ = bus.put(key, bytes.clone()).wait();
            }
            for topic in [StateSample::TOPIC, TorqueSample::TOPIC] {
                let _ = bus.delete(format!("{prefix}/{topic}")).wait();
            }
        }
    }
}

fn put<S: Sample>(bus: &Session, prefix: &str, sample: &S) {
    let mut buffer = [0; LARGEST_SAMPLE];
    let bytes = codec::encode(sample, &mut buffer).to_vec();
    let _ = bus.put(format!("{prefix}/{}", S::TOPIC), bytes).express(true).wait();
}
