//! Attacks on a running session, over either bus.

mod forger;

use std::{
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use forger::{Forger, TOPICS};
use mtj_model::scenario::Wait;
use mtj_protocol::{
    bus::{Bus, BusError, Depth, Reader, Writer},
    codec::{self, LARGEST_SAMPLE},
    iceoryx2::Iceoryx2Bus,
    sample::{ErrorSample, PresenceSample, RequestSample, Sample, StateSample, TorqueSample},
};
use zenoh::Wait as _;

use crate::hostile::RATE;

/// An attack that goes on until it is ended.
pub struct Attack {
    thread: thread::JoinHandle<()>,
    over: Arc<AtomicBool>,
    sent: Arc<AtomicU64>,
}

impl Attack {
    fn begin(attack: impl FnOnce(&dyn Fn() -> bool, &AtomicU64) + Send + 'static) -> Self {
        let (over, sent) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
        let (is_over, count) = (Arc::clone(&over), Arc::clone(&sent));
        let thread = thread::spawn(move || attack(&|| !is_over.load(Ordering::Relaxed), &count));
        Self { thread, over, sent }
    }

    /// Ends it; how many messages it has sent.
    pub fn end(self) -> u64 {
        self.over.store(true, Ordering::Relaxed);
        self.thread.join().unwrap();
        self.sent.load(Ordering::Relaxed)
    }
}

/// Calls `send` at [`RATE`], in bursts as they come from a network, as long as `proceed` says so.
fn at_a_rate(proceed: &dyn Fn() -> bool, sent: &AtomicU64, mut send: impl FnMut(u64)) {
    const BURST: u64 = 50;
    let begun = Instant::now();
    let mut count = 0;
    while proceed() {
        for _ in 0..BURST {
            send(count);
            count += 1;
        }
        sent.store(count, Ordering::Relaxed);
        let due = begun + Duration::from_secs_f64(count as f64 / RATE as f64);
        thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

/// Over Zenoh: all topics, the scenario, and announcements.
pub fn over_zenoh(name: &str, endpoint: &str) -> Attack {
    let (name, endpoint) = (name.to_owned(), endpoint.to_owned());
    Attack::begin(move |proceed, sent| {
        let Some(session) = connect(&endpoint, proceed) else { return };
        let key = |topic: &str| format!("mtj/{name}/{topic}");
        let forger = Arc::new(Mutex::new(Forger::new(1)));
        let heard = Arc::clone(&forger);
        let _ears = session
            .declare_subscriber(key("*"))
            .allowed_origin(zenoh::sample::Locality::Remote)
            .callback(move |sample| {
                let topic = sample.key_expr().as_str().rsplit('/').next().unwrap();
                heard.lock().unwrap().hear(topic, &sample.payload().to_bytes());
            })
            .wait()
            .unwrap();
        while proceed() && !forger.lock().unwrap().knows_the_loop() {
            thread::sleep(Duration::from_millis(1));
        }
        let lies = Arc::clone(&forger);
        let _offers = session
            .declare_queryable(key("scenario"))
            .callback(move |query| {
                let rubbish = lies.lock().unwrap().rubbish(200);
                let _ = query.reply(query.key_expr(), rubbish).wait();
            })
            .wait()
            .unwrap();
        let mut announcement = None;
        at_a_rate(proceed, sent, |count| {
            let mut forger = forger.lock().unwrap();
            if count % 1000 == 0 {
                let id = forger.below(u64::MAX);
                let names = [
                    format!("controller/0/{id}/1"),
                    format!("controller/-{id}/1/1"),
                    format!("controller/{id}/4294967296/1"),
                    format!("controller/{id}/1"),
                    format!("cook/{id}/1/1"),
                    format!("{id}/τ/…/%00"),
                ];
                let member = key(&format!("member/{}", names[forger.below(6) as usize]));
                // The one before goes.
                announcement = Some(session.liveliness().declare_token(member).wait().unwrap());
                return;
            }
            let topic = TOPICS[forger.below(TOPICS.len() as u64) as usize];
            let message = forger.message(topic);
            drop(forger);
            session.put(key(topic), message).wait().unwrap();
        });
        drop(announcement);
        session.close().wait().unwrap();
    })
}

fn connect(endpoint: &str, proceed: &dyn Fn() -> bool) -> Option<zenoh::Session> {
    let mut config = zenoh::Config::default();
    for (key, value) in [
        ("mode", "\"client\"".to_owned()),
        ("connect/endpoints", format!("[{endpoint:?}]")),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).unwrap();
    }
    while proceed() {
        if let Ok(session) = zenoh::open(config.clone()).wait() {
            return Some(session);
        }
        thread::sleep(Duration::from_millis(20));
    }
    None
}

/// In shared memory, as another process of the same user: all topics that it lets a second one
/// write.
pub fn over_iceoryx2(name: &str, _endpoint: &str) -> Attack {
    let name = name.to_owned();
    Attack::begin(move |proceed, sent| {
        let bus = Iceoryx2Bus::open(&name).unwrap();
        let mut forger = Forger::new(2);
        let mut torques = Door::<TorqueSample>::open(&bus).unwrap();
        let mut states: Box<dyn Reader<StateSample>> =
            bus.reader(Depth::Stream, Wait::Spin).unwrap();
        while proceed() && !forger.knows_the_loop() {
            if let Some(torque) = torques.reader.take().unwrap() {
                forger.hear("torque", codec::encode(&torque, &mut [0; LARGEST_SAMPLE]));
            }
            hear_states(&mut *states, &mut forger);
            thread::sleep(Duration::from_millis(1));
        }
        if !proceed() {
            return;
        }
        let mut errors = Door::<ErrorSample>::open(&bus).unwrap();
        let mut requests = Door::<RequestSample>::open(&bus).unwrap();
        let mut presences = Door::<PresenceSample>::open(&bus).unwrap();
        at_a_rate(proceed, sent, |count| match count % 6 {
            0 => {
                hear_states(&mut *states, &mut forger);
                torques.send(&mut forger);
            }
            1 | 2 => torques.send(&mut forger),
            3 => errors.send(&mut forger),
            4 => requests.send(&mut forger),
            _ => presences.send(&mut forger),
        });
    })
}

/// States are the plant's alone; what is heard on the other topics may be our own.
fn hear_states(states: &mut dyn Reader<StateSample>, forger: &mut Forger) {
    while let Some(state) = states.take().unwrap() {
        forger.hear("state", codec::encode(&state, &mut [0; LARGEST_SAMPLE]));
    }
}

/// A topic that can be listened to and written.
struct Door<S> {
    reader: Box<dyn Reader<S>>,
    writer: Box<dyn Writer<S>>,
}

impl<S: Sample> Door<S> {
    fn open(bus: &Iceoryx2Bus) -> Result<Self, BusError> {
        Ok(Self { writer: bus.writer()?, reader: bus.reader(Depth::Stream, Wait::Spin)? })
    }

    fn send(&mut self, forger: &mut Forger) {
        let bytes = forger.sample(S::TOPIC, size_of::<S>());
        self.writer.write(&codec::decode(&bytes).unwrap()).unwrap();
    }
}
