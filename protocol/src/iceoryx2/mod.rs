//! The bus over iceoryx2: zero-copy shared memory between the processes of one machine.
//!
//! Each topic is a publish-subscribe service `mtj/<session>/<topic>` that carries every sample to
//! every reader. In addition, each writer of a sample that closes the loop has a slot, from which
//! its followers get the newest sample sooner. Readers that block have a listener, and writers
//! notify only while there is one, so a spinning loop makes no system calls. The scenario is a
//! service of bytes with a history of one.
//!
//! ```text
//! domain     a user's part of shared memory, and the lock that guards it
//! cleanup    the removal of what crashed processes left
//! resources  memory and descriptors that a process needs
//! members    the processes of a session
//! slot       the newest sample of one writer
//! error      why something could not be created
//! ```

mod cleanup;
mod domain;
mod error;
mod members;
mod resources;
mod slot;

use std::{
    any::Any,
    cell::RefCell,
    io,
    os::fd::BorrowedFd,
    rc::Rc,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use iceoryx2::{
    identifiers::UniquePublisherId,
    port::{
        listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber,
        update_connections::UpdateConnections,
    },
    prelude::*,
    service::port_factory::{event, publish_subscribe},
};
use mtj_model::scenario::Wait;
use nix::poll::{PollFd, PollFlags, ppoll};

pub use self::error::SharedMemoryError;
use self::{
    domain::{CleanupOnDrop, Domain, Locked, Part},
    error::{ServiceError, failure},
    members::Members,
    resources::MAX_OFFER,
    slot::{SlotReader, SlotWriter},
};
use crate::{
    bus::{
        Attendance, Bus, BusError, Depth, Offering, RECENT_DEPTH, Reader, STREAM_DEPTH, Sessions,
        Shared, Writer,
    },
    debug_by_name,
    member::Member,
    sample::Sample,
};

/// How many processes may read a topic, monitors included.
const MAX_READERS: usize = 16;
/// How many processes may write a topic that several may write.
const MAX_WRITERS: usize = 16;
/// How many processes may take part in a session.
const MAX_NODES: usize = 32;
/// How often a reader of a stream polls; it is no part of the loop, so it does not ask to be woken.
const STREAM_POLL: Duration = Duration::from_millis(1);

/// How often a spinning reader polls the slot before it returns; and how often it does that before
/// it polls the stream.
const POLLS: u32 = 32;

/// A session on shared memory.
pub struct Iceoryx2Bus {
    offers: RefCell<Offers>,
    session: Rc<Session>,
}

debug_by_name!(Iceoryx2Bus);

/// Our part in a session.
struct Session {
    name: String,
    node: Locked<Node<ipc::Service>>,
    domain: Arc<Domain>,
    /// Last, because fields are dropped in order: it cleans up when the node is gone.
    _cleanup: CleanupOnDrop,
}

#[derive(Default)]
struct Offers {
    subscriber: Option<Locked<Subscriber<ipc::Service, [u8], ()>>>,
    newest: Option<Vec<u8>>,
}

impl Iceoryx2Bus {
    /// Joins a session, after the cleanup of what crashed processes left.
    pub fn open(session: &str) -> Result<Self, BusError> {
        set_log_level_from_env_or(LogLevel::Fatal);
        let domain = Domain::open()?;
        let node = domain.join()?;
        let _cleanup = CleanupOnDrop(Arc::clone(&domain));
        let session = Session { name: session.to_owned(), node, domain, _cleanup };
        Ok(Self { offers: RefCell::default(), session: Rc::new(session) })
    }
}

impl Session {
    fn service_name(&self, topic: &str) -> Result<ServiceName, ServiceError> {
        Ok(ServiceName::new(&format!("mtj/{}/{topic}", self.name))?)
    }

    fn service<S: Sample>(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, S, ()>, ServiceError> {
        Ok(self
            .node
            .service_builder(&self.service_name(S::TOPIC)?)
            .publish_subscribe::<S>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(STREAM_DEPTH)
            .subscriber_max_borrowed_samples(1)
            .history_size(0)
            .max_publishers(if S::ONE_WRITER { 1 } else { MAX_WRITERS })
            .max_subscribers(MAX_READERS)
            .max_nodes(MAX_NODES)
            .open_or_create()?)
    }

    fn event_service(&self, topic: &str) -> Result<event::PortFactory<ipc::Service>, ServiceError> {
        Ok(self
            .node
            .service_builder(&self.service_name(topic)?)
            .event()
            .max_listeners(MAX_READERS)
            .max_notifiers(MAX_WRITERS)
            .max_nodes(MAX_NODES)
            .open_or_create()?)
    }

    fn offer_service(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, [u8], ()>, ServiceError> {
        Ok(self
            .node
            .service_builder(&self.service_name("scenario")?)
            .publish_subscribe::<[u8]>()
            .enable_safe_overflow(true)
            .history_size(1)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(1)
            .max_publishers(1)
            .max_subscribers(MAX_NODES)
            .max_nodes(MAX_NODES)
            .open_or_create()?)
    }

    fn slot_name<S: Sample>(
        &self,
        publisher: UniquePublisherId,
    ) -> Result<ServiceName, ServiceError> {
        self.service_name(&format!("{}/{}", S::TOPIC, publisher.value()))
    }

    /// Creates something of a topic under the domain's lock.
    fn create<T>(
        &self,
        topic: &str,
        attempt: impl Fn() -> Result<T, ServiceError>,
    ) -> Result<Locked<T>, BusError> {
        let at = |error: ServiceError| error.at(topic, &self.name, self.domain.root());
        Ok(self.domain.create(|| attempt().map_err(at))?)
    }

    fn write_end<S: Sample>(&self) -> Result<WriteEnd<S>, ServiceError> {
        let service = self.service::<S>()?;
        let publisher = service
            .publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()?;
        self.reserve(&service)?;
        let slot = match S::CLOSES_THE_LOOP {
            true => Some(SlotWriter::create(&self.node, &self.slot_name::<S>(publisher.id())?)?),
            false => None,
        };
        let event = self.event_service(S::TOPIC)?;
        let notifier = event.notifier_builder().create()?;
        Ok(WriteEnd { publisher, slot, notifier, event })
    }

    fn read_end<S: Sample>(
        &self,
        buffer: usize,
        listens: bool,
    ) -> Result<ReadEnd<S>, ServiceError> {
        let service = self.service::<S>()?;
        let subscriber = service.subscriber_builder().buffer_size(buffer).create()?;
        self.reserve(&service)?;
        let listener = match listens {
            true => Some(self.event_service(S::TOPIC)?.listener_builder().create()?),
            false => None,
        };
        Ok(ReadEnd { subscriber, listener })
    }

    /// Reserves the memory of a topic's writers for all of its readers.
    fn reserve<S: Sample>(
        &self,
        service: &publish_subscribe::PortFactory<ipc::Service, S, ()>,
    ) -> io::Result<()> {
        let topic = service.dynamic_config();
        let count = topic.number_of_subscribers().clamp(1, MAX_READERS);
        let mut writers = Vec::new();
        topic.list_publishers(|writer| {
            writers.push(writer.publisher_id.value());
            CallbackProgression::Continue
        });
        for writer in writers {
            self.domain.reserve(writer, Part { count, most: MAX_READERS })?;
        }
        Ok(())
    }

    fn offer_end(&self) -> Result<Publisher<ipc::Service, [u8], ()>, ServiceError> {
        let service = self.offer_service()?;
        let publisher = service.publisher_builder().initial_max_slice_len(MAX_OFFER).create()?;
        self.domain.reserve(publisher.id().value(), Part { count: 1, most: MAX_NODES })?;
        Ok(publisher)
    }
}

impl Bus for Iceoryx2Bus {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        let end = self.session.create(S::TOPIC, || self.session.write_end::<S>())?;
        Ok(Box::new(Iceoryx2Writer { end, expedited: None }))
    }

    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        let buffer = match depth {
            Depth::Recent => RECENT_DEPTH,
            Depth::Stream => STREAM_DEPTH,
        };
        let listens = depth != Depth::Stream && wait != Wait::Spin;
        Ok(Box::new(Iceoryx2Reader {
            end: self.session.create(S::TOPIC, || self.session.read_end::<S>(buffer, listens))?,
            streamed: S::default(),
            writer: None,
            followed: None,
            slot: None,
            spins: 0,
            session: Rc::clone(&self.session),
        }))
    }

    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        let mut offer =
            Iceoryx2Offer(self.session.create("scenario", || self.session.offer_end())?);
        offer.renew(bytes)?;
        Ok(Box::new(offer))
    }

    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        let mut offers = self.offers.borrow_mut();
        if offers.subscriber.is_none() {
            let subscribe = || Ok(self.session.offer_service()?.subscriber_builder().create()?);
            offers.subscriber = Some(self.session.create("scenario", subscribe)?);
        }
        while let Some(subscriber) = &offers.subscriber
            && let Some(sample) = subscriber.receive().map_err(failure("scenario"))?
        {
            let bytes = sample.payload().to_vec();
            drop(sample);
            offers.newest = Some(bytes);
        }
        Ok(offers.newest.clone())
    }

    fn announce(&self, member: &Member) -> Result<Box<dyn Any>, BusError> {
        let Session { domain, name, .. } = &*self.session;
        let members = Members::of(domain, name)?;
        let _guard = domain.lock()?;
        Ok(members.announce(member)?)
    }

    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        Ok(Box::new(Members::of(&self.session.domain, &self.session.name)?))
    }

    fn reason_for_silence(&self) -> Option<String> {
        let users = self.session.domain.other_users();
        let user = users.first()?;
        Some(format!(
            "sessions on shared memory are private to a user, and another user (uid {user}) has some \
             on this machine: run as that user, or use --bus zenoh"
        ))
    }
}

impl Shared for Iceoryx2Bus {
    fn within(&self, session: &str) -> Result<Self, BusError> {
        Self::open(session)
    }

    fn sessions(&self) -> Result<Box<dyn Sessions>, BusError> {
        Ok(Box::new(Members::of_all(&self.session.domain)?))
    }
}

struct WriteEnd<S: Sample> {
    publisher: Publisher<ipc::Service, S, ()>,
    slot: Option<SlotWriter<S>>,
    notifier: Notifier<ipc::Service>,
    event: event::PortFactory<ipc::Service>,
}

struct Iceoryx2Writer<S: Sample> {
    end: Locked<WriteEnd<S>>,
    /// The sample that is in the slot only.
    expedited: Option<S>,
}

impl<S: Sample> WriteEnd<S> {
    fn publish(&self, sample: &S) -> Result<(), BusError> {
        self.publisher.send_copy(*sample).map(|_| ()).map_err(failure(S::TOPIC))
    }

    /// Whether a reader sleeps until it is woken.
    fn has_sleepers(&self) -> bool {
        self.event.dynamic_config().number_of_listeners() > 0
    }

    fn wake(&self) {
        if self.has_sleepers() {
            // A listener whose process has crashed meanwhile is no reason to stop.
            let _ = self.notifier.notify();
        }
    }
}

impl<S: Sample> Writer<S> for Iceoryx2Writer<S> {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        self.flush()?;
        if let Some(slot) = &mut self.end.slot {
            slot.write(sample);
        }
        self.end.publish(sample)?;
        self.end.wake();
        Ok(())
    }

    fn expedite(&mut self, sample: &S) -> Result<(), BusError> {
        let Some(slot) = &mut self.end.slot else { return self.write(sample) };
        slot.write(sample);
        self.flush()?;
        self.expedited = Some(*sample);
        if self.end.has_sleepers() {
            // A reader that sleeps may not follow us yet, and is woken only once.
            self.flush()?;
            self.end.wake();
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), BusError> {
        let Some(sample) = self.expedited.take() else { return Ok(()) };
        if let Some(slot) = &mut self.end.slot {
            slot.prefetch(&sample);
        }
        self.end.publish(&sample)
    }
}

struct ReadEnd<S: Sample> {
    subscriber: Subscriber<ipc::Service, S, ()>,
    listener: Option<Listener<ipc::Service>>,
}

struct Iceoryx2Reader<S: Sample> {
    end: Locked<ReadEnd<S>>,
    /// The newest sample of the stream.
    streamed: S,
    /// Its writer, if it is the current sample; `None` while the current sample is the slot's.
    writer: Option<UniquePublisherId>,
    followed: Option<UniquePublisherId>,
    /// The slot of the writer that is followed, if it has one.
    slot: Option<Locked<SlotReader<S>>>,
    spins: u32,
    session: Rc<Session>,
}

impl<S: Sample> Iceoryx2Reader<S> {
    /// Advances to the next sample of the stream that the slot does not deliver.
    fn advance_in_stream(&mut self) -> Result<bool, BusError> {
        for _ in 0..RECENT_DEPTH {
            let found = self.end.subscriber.receive().map_err(failure(S::TOPIC))?;
            let Some(sample) = found else { break };
            let writer = sample.header().publisher_id();
            if self.slot.is_none() || self.followed != Some(writer) {
                self.writer = Some(writer);
                self.streamed = *sample.payload();
                return Ok(true);
            }
        }
        Ok(false)
    }
}

impl<S: Sample> Reader<S> for Iceoryx2Reader<S> {
    fn advance(&mut self) -> Result<bool, BusError> {
        if self.slot.as_mut().is_some_and(|slot| slot.advance()) {
            self.writer = None;
            return Ok(true);
        }
        self.advance_in_stream()
    }

    fn sample(&self) -> &S {
        match &self.slot {
            Some(slot) if self.writer.is_none() => slot.sample(),
            _ => &self.streamed,
        }
    }

    fn spin(&mut self) -> Result<bool, BusError> {
        let Some(slot) = &self.slot else { return self.advance() };
        for _ in 0..POLLS {
            if slot.has_news() {
                return self.advance();
            }
            std::hint::spin_loop();
        }
        // To poll the stream takes as long as all of the above, and it seldom has what closes the
        // loop.
        self.spins = self.spins.wrapping_add(1);
        if self.spins.is_multiple_of(POLLS) { self.advance() } else { Ok(false) }
    }

    fn sleep(&mut self, until: Instant) -> Result<(), BusError> {
        let patience = until.saturating_duration_since(Instant::now());
        match &self.end.listener {
            None => thread::sleep(patience.min(STREAM_POLL)),
            Some(listener) => {
                wait_readable(listener, patience);
                // A signal may interrupt this; the caller checks whether there is a sample.
                let _ = listener.try_wait(|_| {});
            }
        }
        Ok(())
    }

    fn follow(&mut self) -> Result<(), BusError> {
        // The slot's sample is of the writer that is followed already.
        let Some(writer) = self.writer else { return Ok(()) };
        if self.followed == Some(writer) {
            return Ok(());
        }
        let (session, known) = (&self.session, self.streamed.header());
        let open = || {
            let name = session.slot_name::<S>(writer)?;
            SlotReader::open(&session.node, &name, known)
        };
        // The stream delivers the samples of a writer that has no slot or is gone, and of any
        // writer for as long as another process holds the lock.
        if session.domain.try_replace(&mut self.slot, || open().ok()) {
            self.followed = Some(writer);
        }
        Ok(())
    }

    fn follows(&self) -> bool {
        self.slot.is_some()
    }

    fn has_more(&self) -> bool {
        match &self.slot {
            Some(slot) => slot.has_news(),
            None => self.end.subscriber.has_samples().unwrap_or(false),
        }
    }

    fn malformed(&self) -> u64 {
        0 // Shared memory is typed: a process with another layout cannot open the service.
    }
}

struct Iceoryx2Offer(Locked<Publisher<ipc::Service, [u8], ()>>);

impl Offering for Iceoryx2Offer {
    fn renew(&mut self, bytes: Vec<u8>) -> Result<(), BusError> {
        if bytes.len() > MAX_OFFER {
            return Err(SharedMemoryError::OfferTooLong { length: bytes.len() }.into());
        }
        let sample = self.0.loan_slice_uninit(bytes.len()).map_err(failure("scenario"))?;
        sample.write_from_slice(&bytes).send().map_err(failure("scenario"))?;
        Ok(())
    }

    fn serve(&mut self) -> Result<(), BusError> {
        self.0.update_connections().map_err(failure("scenario"))
    }
}

/// Sleeps until the listener is notified, or for `patience`, to the microsecond.
///
/// The listener's own timed wait counts in kernel ticks of some milliseconds, which would miss
/// sampling instants.
#[expect(unsafe_code, reason = "a listener has only a raw descriptor to lend")]
fn wait_readable(listener: &Listener<ipc::Service>, patience: Duration) {
    // SAFETY: the descriptor belongs to the listener, which outlives this borrow and keeps it open.
    let descriptor = unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) };
    let mut descriptors = [PollFd::new(descriptor, PollFlags::POLLIN)];
    // An interruption by a signal is a wake-up like any other.
    let _ = ppoll(&mut descriptors, Some(patience.into()), None);
}
