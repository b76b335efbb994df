//! The conformance suite over each of the three buses.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_conformance::Fixture;
use mtj_protocol::{local::LocalBus, member::Role};

mod local {
    use super::*;

    struct Local(LocalBus);

    impl Fixture for Local {
        type Bus = LocalBus;

        fn new() -> Self {
            Self(LocalBus::default())
        }
        fn join(&self, _role: Role) -> LocalBus {
            self.0.clone()
        }
    }

    mtj_conformance::suite!(Local);
}

/// The settings of a session that no other test uses.
#[cfg(any(feature = "iceoryx2", feature = "zenoh"))]
fn settings(text: &str) -> mtj_model::scenario::BusSettings {
    use std::sync::atomic::{AtomicU64, Ordering};

    static COUNT: AtomicU64 = AtomicU64::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    let text = format!("{text}\nsession = 'conformance-{}-{count}'", std::process::id());
    mtj_model::scenario::BusSettings::from_table("here", text.parse().unwrap()).unwrap()
}

#[cfg(feature = "iceoryx2")]
mod iceoryx2 {
    use mtj_protocol::iceoryx2::Iceoryx2Bus;

    use super::*;

    struct Iceoryx2(String);

    impl Fixture for Iceoryx2 {
        type Bus = Iceoryx2Bus;

        fn new() -> Self {
            Self(settings("kind = 'iceoryx2'").session)
        }
        fn join(&self, _role: Role) -> Iceoryx2Bus {
            Iceoryx2Bus::open(&self.0).unwrap()
        }
    }

    mtj_conformance::suite!(Iceoryx2);
}

#[cfg(feature = "zenoh")]
mod zenoh {
    use std::net::TcpListener;

    use ::zenoh::Wait as _;
    use mtj_model::scenario::BusSettings;
    use mtj_protocol::zenoh::ZenohBus;

    use super::*;

    struct Zenoh(BusSettings);

    impl Fixture for Zenoh {
        type Bus = ZenohBus;
        const LOSSY: bool = true;

        fn new() -> Self {
            let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
            Self(settings(&format!("kind = 'zenoh'\nlisten = 'tcp/127.0.0.1:{port}'")))
        }
        fn join(&self, role: Role) -> ZenohBus {
            ZenohBus::open(&self.0, role, &|| true).unwrap().unwrap()
        }
        fn put_garbage(&self, topic: &str, bytes: &[u8]) -> bool {
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
            session.put(format!("mtj/{}/{topic}", self.0.session), bytes).wait().unwrap();
            session.close().wait().unwrap();
            true
        }
    }

    mtj_conformance::suite!(Zenoh);
}
