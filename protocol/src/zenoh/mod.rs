//! The bus over Zenoh: between machines, or processes that should not share memory.
//!
//! The plant is a Zenoh peer that listens; controllers and monitors are clients that connect to it.
//! Or all connect to a router. So all traffic of a session passes through explicit addresses.
//! Samples travel express (no batching), with real-time priority, and are dropped rather than
//! queued when the network is congested: a late sample is worth less than the next one.
//!
//! ```text
//! config       the session's configuration, made of the user's settings
//! credentials  certificates, and the TLS settings made of them
//! access       which role may write and read which topic
//! exposure     the check that no session is open to the network by accident
//! recovery     the return of a session after the network failed
//! threads      the number of threads on which Zenoh reads and writes
//! error        why Zenoh cannot be used
//! diagnosis    why there is no connection yet
//! ```

mod access;
mod config;
mod credentials;
mod diagnosis;
mod error;
mod exposure;
mod recovery;
pub mod threads;

use std::{
    any::Any,
    collections::BTreeSet,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::{BusSettings, Wait};
use zenoh::{
    Config, Session, Wait as _,
    pubsub::Publisher,
    qos::{CongestionControl, Priority},
    query::{ConsolidationMode, QueryTarget},
    sample::SampleKind,
};

pub use self::error::ZenohError;
use self::{diagnosis::Diagnosis, recovery::LingerGuard};
use crate::{
    bus::{Attendance, Bus, BusError, Depth, Offering, Reader, Sessions, Shared, Writer},
    codec::{self, LARGEST_SAMPLE},
    debug_by_name,
    mailbox::{Mailbox, MailboxReader},
    member::{Member, Role},
    sample::{Sample, VERSION},
};

/// How long to wait between two attempts to connect.
const RETRY: Duration = Duration::from_millis(100);
/// How long an answer to a query may take.
const QUERY_TIMEOUT: Duration = Duration::from_secs(1);

/// A session on Zenoh.
pub struct ZenohBus {
    session: Session,
    prefix: String,
    _linger: Arc<LingerGuard>,
}

debug_by_name!(ZenohBus);

impl ZenohBus {
    /// Opens a Zenoh session. A role that does not listen tries to connect for as long as `proceed`
    /// returns true; `None` when it no longer does.
    pub fn open(
        settings: &BusSettings,
        role: Role,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, BusError> {
        Self::connect(config::configure(settings, role)?, settings, role, proceed)
    }

    /// Opens the session of a bridge, in the place of the plant.
    pub fn open_for_bridge(
        settings: &BusSettings,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, BusError> {
        let mut settings = settings.clone();
        if !config::listens(&settings, Role::Plant) {
            // A router accepts torques from controllers, and all topics from other routers.
            settings.identity.get_or_insert_with(|| "router".to_owned());
        }
        let mut config = config::configure(&settings, Role::Plant)?;
        config::wait_before_drop(&mut config)?;
        Self::connect(config, &settings, Role::Plant, proceed)
    }

    fn connect(
        config: Config,
        settings: &BusSettings,
        role: Role,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, BusError> {
        if config::has_tls(&config) {
            threads::use_one_thread();
        }
        let _diagnosis = (!config::listens(settings, role))
            .then(|| Diagnosis::begin(settings.connect_endpoints(), settings.certs.is_some()));
        let session = loop {
            if !proceed() {
                return Ok(None);
            }
            match zenoh::open(config.clone()).wait() {
                Ok(session) => break session,
                Err(source) if config::listens(settings, role) => {
                    let endpoints = settings.listen_endpoints().join(", ");
                    return Err(ZenohError::Listen { endpoints, source }.into());
                }
                Err(_) => thread::sleep(RETRY),
            }
        };
        Ok(Some(Self {
            session,
            prefix: format!("mtj/{}", settings.session),
            _linger: Arc::new(LingerGuard::start()?),
        }))
    }

    /// Checks that the settings make a Zenoh configuration.
    pub fn check(settings: &BusSettings) -> Result<(), BusError> {
        config::configure(settings, Role::Plant)?;
        Ok(())
    }

    fn key(&self, topic: &str) -> String {
        format!("{}/{topic}", self.prefix)
    }
}

impl Bus for ZenohBus {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        let publisher = self
            .session
            .declare_publisher(self.key(S::TOPIC))
            .express(true)
            .priority(Priority::RealTime)
            .congestion_control(CongestionControl::Drop)
            .wait()
            .map_err(failure)?;
        Ok(Box::new(ZenohWriter { publisher }))
    }

    fn reader<S: Sample>(&self, depth: Depth, _wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        let mailbox = Mailbox::<S>::new(depth);
        let arrivals = Arc::clone(&mailbox);
        let subscriber = self
            .session
            .declare_subscriber(self.key(S::TOPIC))
            .callback(move |message| match codec::read(&message.payload().to_bytes()) {
                Some(sample) => arrivals.put(sample),
                None => arrivals.put_malformed(),
            })
            .wait()
            .map_err(failure)?;
        Ok(Box::new(MailboxReader::new(mailbox, subscriber)))
    }

    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        let bytes = Arc::new(Mutex::new(bytes));
        let on_offer = Arc::clone(&bytes);
        let queryable = self
            .session
            .declare_queryable(self.key("scenario"))
            .callback(move |query| {
                let bytes = lock(&on_offer).clone();
                // A peer whose link breaks before the answer asks again.
                let _ = query.reply(query.key_expr(), bytes).wait();
            })
            .wait()
            .map_err(failure)?;
        Ok(Box::new(ZenohOffer { bytes, _keep: queryable }))
    }

    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        let replies = self
            .session
            .get(self.key("scenario"))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .timeout(QUERY_TIMEOUT)
            .wait()
            .map_err(failure)?;
        let end = Instant::now() + QUERY_TIMEOUT;
        let mut other = None;
        while let Ok(Some(reply)) = replies.recv_deadline(end) {
            let Ok(sample) = reply.result() else { continue };
            // Any process may answer; an offer of our version is preferred.
            let bytes = sample.payload().to_bytes().into_owned();
            if codec::decode_offer(&bytes).is_some_and(|offer| offer.version == VERSION) {
                return Ok(Some(bytes));
            }
            other = Some(bytes);
        }
        Ok(other)
    }

    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
        let token = self
            .session
            .liveliness()
            .declare_token(self.key(&format!("member/{member}")))
            .wait()
            .map_err(failure)?;
        Ok(Box::new(token))
    }

    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        let members = Arc::new(Mutex::new(Vec::new()));
        let (heard, key) = (Arc::clone(&members), self.key("member/"));
        let subscriber = self
            .session
            .liveliness()
            .declare_subscriber(format!("{key}**"))
            .history(true)
            .callback(move |sample| {
                let name = sample.key_expr().as_str().strip_prefix(&key);
                let Some(Ok(member)) = name.map(str::parse::<Member>) else { return };
                let mut members = lock(&heard);
                members.retain(|known: &Member| known.id != member.id);
                if sample.kind() == SampleKind::Put {
                    members.push(member);
                }
            })
            .wait()
            .map_err(failure)?;
        // What the subscriber hears of the past comes some time later; a caller wants it now.
        let announced = self
            .session
            .liveliness()
            .get(format!("{}**", self.key("member/")))
            .timeout(QUERY_TIMEOUT)
            .wait()
            .map_err(failure)?;
        let end = Instant::now() + QUERY_TIMEOUT;
        while let Ok(Some(reply)) = announced.recv_deadline(end) {
            let Ok(sample) = reply.result() else { continue };
            let name = sample.key_expr().as_str().strip_prefix(&self.key("member/"));
            let Some(Ok(member)) = name.map(str::parse::<Member>) else { continue };
            let mut members = lock(&members);
            if !members.contains(&member) {
                members.push(member);
            }
        }
        Ok(Box::new(ZenohAttendance { members, _keep: subscriber }))
    }
}

impl Shared for ZenohBus {
    fn within(&self, session: &str) -> Result<Self, BusError> {
        Ok(Self {
            session: self.session.clone(),
            prefix: format!("mtj/{session}"),
            _linger: Arc::clone(&self._linger),
        })
    }

    fn sessions(&self) -> Result<Box<dyn Sessions>, BusError> {
        let announced = Arc::new(Mutex::new(BTreeSet::new()));
        let heard = Arc::clone(&announced);
        let subscriber = self
            .session
            .liveliness()
            .declare_subscriber("mtj/*/member/**")
            .history(true)
            .callback(move |sample| {
                let key = sample.key_expr().as_str().strip_prefix("mtj/");
                let Some((session, member)) = key.and_then(|key| key.split_once("/member/")) else {
                    return;
                };
                let announcement = (session.to_owned(), member.to_owned());
                match sample.kind() {
                    SampleKind::Put => lock(&heard).insert(announcement),
                    SampleKind::Delete => lock(&heard).remove(&announcement),
                };
            })
            .wait()
            .map_err(failure)?;
        Ok(Box::new(ZenohSessions { announced, _keep: subscriber }))
    }
}

struct ZenohSessions<K> {
    /// Pairs of a session and a member.
    announced: Arc<Mutex<BTreeSet<(String, String)>>>,
    _keep: K,
}

impl<K> Sessions for ZenohSessions<K> {
    fn names(&mut self) -> Result<BTreeSet<String>, BusError> {
        Ok(lock(&self.announced).iter().map(|(session, _)| session.clone()).collect())
    }
}

struct ZenohAttendance<K> {
    members: Arc<Mutex<Vec<Member>>>,
    _keep: K,
}

impl<K> Attendance for ZenohAttendance<K> {
    fn present(&mut self) -> Result<Vec<Member>, BusError> {
        Ok(lock(&self.members).clone())
    }

    fn is_present(&mut self, member: &Member) -> Result<bool, BusError> {
        Ok(lock(&self.members).contains(member))
    }
}

struct ZenohWriter {
    publisher: Publisher<'static>,
}

impl<S: Sample> Writer<S> for ZenohWriter {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        let mut buffer = [0; LARGEST_SAMPLE];
        self.publisher.put(codec::encode(sample, &mut buffer)).wait().map_err(failure)
    }
}

struct ZenohOffer<Q> {
    bytes: Arc<Mutex<Vec<u8>>>,
    _keep: Q,
}

impl<Q> Offering for ZenohOffer<Q> {
    fn renew(&mut self, bytes: Vec<u8>) -> Result<(), BusError> {
        *lock(&self.bytes) = bytes;
        Ok(())
    }

    fn serve(&mut self) -> Result<(), BusError> {
        Ok(())
    }
}

/// Locks, also after a panic elsewhere: nothing here can panic while it holds the lock.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn failure(error: zenoh::Error) -> BusError {
    ZenohError::Session(error).into()
}
