//! Zenoh over TCP on loopback, as in its own `z_ping` and `z_pong`: the one answers where the
//! sample arrives, the other waits for it. What is sent goes as ours does: express, real-time
//! priority, dropped rather than queued.

use std::{
    thread,
    time::{Duration, Instant},
};

use mtj_plant::durations::Durations;
use mtj_protocol::{
    codec::{self, LARGEST_SAMPLE},
    sample::{StateSample, TorqueSample},
};
use zenoh::{
    Config, Session, Wait,
    pubsub::Publisher,
    qos::{CongestionControl, Priority},
};

use super::WARM_UP;
use crate::failure::Failure;

const THERE: &str = "mtj-bare/there";
const BACK: &str = "mtj-bare/back";
/// How long to wait for an answer before the other process counts as gone.
const GONE: Duration = Duration::from_secs(5);
/// How long to wait before trying again.
const RETRY: Duration = Duration::from_millis(20);

/// Listens at `place`, sends states and takes torques.
pub fn ping(place: &str, samples: u64) -> Result<Durations, Failure> {
    let session = open("listen", "peer", place)?;
    let back = session.declare_subscriber(BACK).wait().map_err(failure)?;
    let there = publisher(&session, THERE)?;
    let mut buffer = [0; LARGEST_SAMPLE];
    let state = codec::encode(&StateSample::default(), &mut buffer);
    // The other process may still be on its way: the first sample is repeated until it is answered.
    let end = Instant::now() + GONE;
    loop {
        there.put(state).wait().map_err(failure)?;
        if back.recv_timeout(RETRY).map_err(failure)?.is_some() {
            break;
        }
        if Instant::now() >= end {
            return Err(Failure::other("no answer over bare Zenoh"));
        }
    }
    while back.recv_timeout(RETRY).map_err(failure)?.is_some() {}
    let mut trips = Durations::default();
    for k in 0..WARM_UP + samples {
        let began = Instant::now();
        there.put(state).wait().map_err(failure)?;
        if back.recv_timeout(GONE).map_err(failure)?.is_none() {
            return Err(Failure::other("the answers over bare Zenoh ceased"));
        }
        let took = began.elapsed();
        if k >= WARM_UP {
            trips.record(took.as_nanos() as u64);
        }
    }
    Ok(trips)
}

/// Connects to `place` and answers each state with a torque.
pub fn pong(place: &str, proceed: &dyn Fn() -> bool) -> Result<(), Failure> {
    let session = loop {
        match open("connect", "client", place) {
            Ok(session) => break session,
            Err(_) if proceed() => thread::sleep(RETRY),
            Err(error) => return Err(error),
        }
    };
    let back = publisher(&session, BACK)?;
    let mut buffer = [0; LARGEST_SAMPLE];
    let torque = codec::encode(&TorqueSample::default(), &mut buffer).to_vec();
    let _subscriber = session
        .declare_subscriber(THERE)
        .callback(move |_| {
            // The other end misses an answer, and says so.
            let _ = back.put(torque.as_slice()).wait();
        })
        .wait()
        .map_err(failure)?;
    while proceed() {
        thread::sleep(RETRY);
    }
    Ok(())
}

fn open(how: &str, mode: &str, place: &str) -> Result<Session, Failure> {
    let mut config = Config::default();
    for (key, value) in [
        ("mode", format!("\"{mode}\"")),
        (&*format!("{how}/endpoints"), format!("[\"{place}\"]")),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
    ] {
        config.insert_json5(key, &value).map_err(failure)?;
    }
    zenoh::open(config).wait().map_err(failure)
}

fn publisher(session: &Session, key: &'static str) -> Result<Publisher<'static>, Failure> {
    session
        .declare_publisher(key)
        .express(true)
        .priority(Priority::RealTime)
        .congestion_control(CongestionControl::Drop)
        .wait()
        .map_err(failure)
}

fn failure(error: impl std::fmt::Debug) -> Failure {
    Failure::other(format_args!("bare Zenoh: {error:?}"))
}
