//! The bus over iceoryx2: zero-copy shared memory between the processes of one machine.
//!
//! Each topic is a publish-subscribe service `mtj/<session>/<topic>`, through which everybody gets every sample.
//! Beside it each writer of what closes the loop has a slot, from which those who follow it get the newest
//! sample sooner. Readers that block have a listener, and writers notify only while there is one, so a spinning
//! loop makes no system calls. The scenario is a service of bytes with a history of one.

mod domain;
mod error;
mod members;
mod resources;
mod slot;
mod sweep;

use std::{
    any::Any,
    cell::RefCell,
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

use self::{
    domain::{Cleanup, Domain, Indoors},
    error::Trouble,
    members::Members,
    resources::failure,
    slot::{SlotReader, SlotWriter},
};
use crate::{
    bus::{
        Attendance, Bus, BusError, Depth, Offering, RECENT_DEPTH, Reader, STREAM_DEPTH, Sessions,
        Shared, Writer,
    },
    member::Member,
    sample::Sample,
};

/// How many processes may read a topic, monitors included.
const MAX_READERS: usize = 16;
/// How many processes may write a topic that several may write.
const MAX_WRITERS: usize = 16;
/// How many processes may take part in a session.
const MAX_NODES: usize = 32;
/// The longest scenario, bytes.
const MAX_OFFER: usize = 65536;
/// How often a stream's reader looks again; it is no part of the loop, so it does not ask to be woken.
const STREAM_POLL: Duration = Duration::from_millis(1);

/// How often a spinning reader looks at the writer it follows before it looks at the clock; and how often it does
/// that before it looks at what others have written.
const LOOKS: u32 = 32;

/// A session on shared memory.
pub struct Iceoryx2Bus {
    offers: RefCell<Offers>,
    place: Rc<Place>,
}

/// Where a session is, and our part in it.
struct Place {
    session: String,
    node: Indoors<Node<ipc::Service>>,
    domain: Arc<Domain>,
    /// Last, because fields are dropped in order: it sweeps when the node has gone.
    _cleanup: Cleanup,
}

#[derive(Default)]
struct Offers {
    subscriber: Option<Indoors<Subscriber<ipc::Service, [u8], ()>>>,
    newest: Option<Vec<u8>>,
}

impl Iceoryx2Bus {
    /// Joins the session, after clearing away what dead processes left behind.
    pub fn open(session: &str) -> Result<Self, BusError> {
        set_log_level_from_env_or(LogLevel::Fatal);
        let domain = Domain::open()?;
        let node = domain.settle()?;
        let _cleanup = Cleanup(Arc::clone(&domain));
        let place = Place { session: session.to_owned(), node, domain, _cleanup };
        Ok(Self { offers: RefCell::default(), place: Rc::new(place) })
    }
}

impl Place {
    fn name(&self, topic: &str) -> Result<ServiceName, Trouble> {
        Ok(ServiceName::new(&format!("mtj/{}/{topic}", self.session))?)
    }

    fn service<S: Sample>(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, S, ()>, Trouble> {
        Ok(self
            .node
            .service_builder(&self.name(S::TOPIC)?)
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

    fn event_service(&self, topic: &str) -> Result<event::PortFactory<ipc::Service>, Trouble> {
        Ok(self
            .node
            .service_builder(&self.name(topic)?)
            .event()
            .max_listeners(MAX_READERS)
            .max_notifiers(MAX_WRITERS)
            .max_nodes(MAX_NODES)
            .open_or_create()?)
    }

    fn offer_service(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, [u8], ()>, Trouble> {
        Ok(self
            .node
            .service_builder(&self.name("scenario")?)
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

    fn slot_name<S: Sample>(&self, publisher: UniquePublisherId) -> Result<ServiceName, Trouble> {
        self.name(&format!("{}/{}", S::TOPIC, publisher.value()))
    }

    /// Makes something of a topic's, or says why not.
    fn make<T>(
        &self,
        topic: &str,
        attempt: impl Fn() -> Result<T, Trouble>,
    ) -> Result<Indoors<T>, BusError> {
        let refuse = |trouble: Trouble| trouble.at(topic, &self.session, self.domain.root());
        self.domain.make(|| attempt().map_err(refuse))
    }

    fn write_end<S: Sample>(&self) -> Result<WriteEnd<S>, Trouble> {
        let publisher = self
            .service::<S>()?
            .publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()?;
        self.domain.reserve(publisher.id().value(), MAX_READERS)?;
        let slot = match S::CLOSES_THE_LOOP {
            true => Some(SlotWriter::create(&self.node, &self.slot_name::<S>(publisher.id())?)?),
            false => None,
        };
        let event = self.event_service(S::TOPIC)?;
        let notifier = event.notifier_builder().create()?;
        Ok(WriteEnd { publisher, slot, notifier, event })
    }

    fn read_end<S: Sample>(&self, buffer: usize, listens: bool) -> Result<ReadEnd<S>, Trouble> {
        let subscriber = self.service::<S>()?.subscriber_builder().buffer_size(buffer).create()?;
        let listener = match listens {
            true => Some(self.event_service(S::TOPIC)?.listener_builder().create()?),
            false => None,
        };
        Ok(ReadEnd { subscriber, listener })
    }

    fn offer_end(&self) -> Result<Publisher<ipc::Service, [u8], ()>, Trouble> {
        let service = self.offer_service()?;
        let publisher = service.publisher_builder().initial_max_slice_len(MAX_OFFER).create()?;
        self.domain.reserve(publisher.id().value(), MAX_NODES)?;
        Ok(publisher)
    }
}

impl Bus for Iceoryx2Bus {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        let end = self.place.make(S::TOPIC, || self.place.write_end::<S>())?;
        Ok(Box::new(Iceoryx2Writer { end, expedited: None }))
    }

    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        let buffer = match depth {
            Depth::Recent => RECENT_DEPTH,
            Depth::Stream => STREAM_DEPTH,
        };
        let listens = depth != Depth::Stream && wait != Wait::Spin;
        Ok(Box::new(Iceoryx2Reader {
            end: self.place.make(S::TOPIC, || self.place.read_end::<S>(buffer, listens))?,
            streamed: S::default(),
            writer: None,
            followed: None,
            slot: None,
            spins: 0,
            place: Rc::clone(&self.place),
        }))
    }

    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        let mut offer = Iceoryx2Offer(self.place.make("scenario", || self.place.offer_end())?);
        offer.renew(bytes)?;
        Ok(Box::new(offer))
    }

    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        let mut offers = self.offers.borrow_mut();
        if offers.subscriber.is_none() {
            let subscribe = || Ok(self.place.offer_service()?.subscriber_builder().create()?);
            offers.subscriber = Some(self.place.make("scenario", subscribe)?);
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
        let Place { domain, session, .. } = &*self.place;
        let members = Members::of(domain, session)?;
        let _inside = domain.enter()?;
        members.announce(member)
    }

    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        Ok(Box::new(Members::of(&self.place.domain, &self.place.session)?))
    }
}

impl Shared for Iceoryx2Bus {
    fn within(&self, session: &str) -> Result<Self, BusError> {
        Self::open(session)
    }

    fn sessions(&self) -> Result<Box<dyn Sessions>, BusError> {
        Ok(Box::new(Members::of_all(&self.place.domain)?))
    }
}

struct WriteEnd<S: Sample> {
    publisher: Publisher<ipc::Service, S, ()>,
    slot: Option<SlotWriter<S>>,
    notifier: Notifier<ipc::Service>,
    event: event::PortFactory<ipc::Service>,
}

struct Iceoryx2Writer<S: Sample> {
    end: Indoors<WriteEnd<S>>,
    /// What is not in the stream yet.
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
            // A listener that died meanwhile is no reason to stop.
            let _ = self.notifier.notify();
        }
    }
}

impl<S: Sample> Writer<S> for Iceoryx2Writer<S> {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        self.settle()?;
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
        self.settle()?;
        self.expedited = Some(*sample);
        if self.end.has_sleepers() {
            // A reader that sleeps may not follow us yet, and is woken but once.
            self.settle()?;
            self.end.wake();
        }
        Ok(())
    }

    fn settle(&mut self) -> Result<(), BusError> {
        let Some(sample) = self.expedited.take() else { return Ok(()) };
        if let Some(slot) = &mut self.end.slot {
            slot.prepare(&sample);
        }
        self.end.publish(&sample)
    }
}

struct ReadEnd<S: Sample> {
    subscriber: Subscriber<ipc::Service, S, ()>,
    listener: Option<Listener<ipc::Service>>,
}

struct Iceoryx2Reader<S: Sample> {
    end: Indoors<ReadEnd<S>>,
    /// What came last by the stream, and who wrote it if that is the sample at hand.
    streamed: S,
    writer: Option<UniquePublisherId>,
    followed: Option<UniquePublisherId>,
    /// Of the writer that is followed, if it has one.
    slot: Option<Indoors<SlotReader<S>>>,
    spins: u32,
    place: Rc<Place>,
}

impl<S: Sample> Iceoryx2Reader<S> {
    /// Goes on to the next sample of the stream that did not come by the slot.
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
        for _ in 0..LOOKS {
            if slot.has_news() {
                return self.advance();
            }
            std::hint::spin_loop();
        }
        // To look there takes as long as all of the above, and what closes the loop does not come from there.
        self.spins = self.spins.wrapping_add(1);
        if self.spins.is_multiple_of(LOOKS) { self.advance() } else { Ok(false) }
    }

    fn sleep(&mut self, until: Instant) -> Result<(), BusError> {
        let patience = until.saturating_duration_since(Instant::now());
        match &self.end.listener {
            None => thread::sleep(patience.min(STREAM_POLL)),
            Some(listener) => {
                wait_readable(listener, patience);
                // A signal may interrupt this; the caller looks for itself whether there is a sample.
                let _ = listener.try_wait(|_| {});
            }
        }
        Ok(())
    }

    fn follow(&mut self) -> Result<(), BusError> {
        // What came by the slot leaves nothing to be done.
        let Some(writer) = self.writer else { return Ok(()) };
        if self.followed == Some(writer) {
            return Ok(());
        }
        let (place, known) = (&self.place, self.streamed.header());
        let open = || {
            let name = place.slot_name::<S>(writer)?;
            SlotReader::open(&place.node, &name, known)
        };
        // A writer that has none, or has gone, is heard through the stream; so is one for as long as somebody else
        // is at the door.
        if place.domain.replace(&mut self.slot, || open().ok()) {
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

struct Iceoryx2Offer(Indoors<Publisher<ipc::Service, [u8], ()>>);

impl Offering for Iceoryx2Offer {
    fn renew(&mut self, bytes: Vec<u8>) -> Result<(), BusError> {
        if bytes.len() > MAX_OFFER {
            return Err(BusError::Settings(format!(
                "the scenario is {} bytes long; shared memory takes up to {MAX_OFFER}",
                bytes.len()
            )));
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
/// The listener's own timed wait counts in kernel ticks of some milliseconds, by which a sampling
/// instant must not be missed.
#[expect(unsafe_code, reason = "a listener has only a raw descriptor to lend")]
fn wait_readable(listener: &Listener<ipc::Service>, patience: Duration) {
    // SAFETY: the descriptor belongs to the listener, which outlives this borrow and keeps it open.
    let descriptor = unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) };
    let mut descriptors = [PollFd::new(descriptor, PollFlags::POLLIN)];
    // An interruption by a signal is a wake-up like any other.
    let _ = ppoll(&mut descriptors, Some(patience.into()), None);
}
