//! The bus over iceoryx2: zero-copy shared memory between the processes of one machine.
//!
//! Each topic is a publish-subscribe service `mtj/<session>/<topic>`. A loop's reader has a buffer
//! of one with safe overflow, so the newest sample wins; a stream's reader has a deep one. Readers
//! that block have a listener beside it, and writers notify only while there is one, so a spinning
//! loop makes no system calls. The scenario is a service of bytes with a history of one.

mod domain;
mod members;
mod refusal;
mod scarcity;

use std::{
    any::Any,
    cell::RefCell,
    os::fd::BorrowedFd,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use iceoryx2::{
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
    domain::{Broom, Domain, Indoors},
    members::Members,
    refusal::Trouble,
    scarcity::failure,
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

/// A session on shared memory.
pub struct Iceoryx2Bus {
    offers: RefCell<Offers>,
    session: String,
    node: Indoors<Node<ipc::Service>>,
    domain: Arc<Domain>,
    /// Last, because fields are dropped in order: it sweeps when the node has gone.
    _broom: Broom,
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
        Ok(Self {
            offers: RefCell::default(),
            session: session.to_owned(),
            node,
            _broom: Broom(Arc::clone(&domain)),
            domain,
        })
    }

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
        let event = self.event_service(S::TOPIC)?;
        let notifier = event.notifier_builder().create()?;
        Ok(WriteEnd { publisher, notifier, event })
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
        Ok(Box::new(Iceoryx2Writer(self.make(S::TOPIC, || self.write_end::<S>())?)))
    }

    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        let buffer = match depth {
            Depth::Latest => 1,
            Depth::Recent => RECENT_DEPTH,
            Depth::Stream => STREAM_DEPTH,
        };
        let listens = depth != Depth::Stream && wait == Wait::Block;
        Ok(Box::new(Iceoryx2Reader(self.make(S::TOPIC, || self.read_end::<S>(buffer, listens))?)))
    }

    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        let mut offer = Iceoryx2Offer(self.make("scenario", || self.offer_end())?);
        offer.renew(bytes)?;
        Ok(Box::new(offer))
    }

    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        let mut offers = self.offers.borrow_mut();
        if offers.subscriber.is_none() {
            let subscribe = || Ok(self.offer_service()?.subscriber_builder().create()?);
            offers.subscriber = Some(self.make("scenario", subscribe)?);
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
        let members = Members::of(&self.domain, &self.session)?;
        let _inside = self.domain.enter()?;
        members.announce(member)
    }

    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        Ok(Box::new(Members::of(&self.domain, &self.session)?))
    }
}

impl Shared for Iceoryx2Bus {
    fn within(&self, session: &str) -> Result<Self, BusError> {
        Self::open(session)
    }

    fn sessions(&self) -> Result<Box<dyn Sessions>, BusError> {
        Ok(Box::new(Members::of_all(&self.domain)?))
    }
}

struct WriteEnd<S: Sample> {
    publisher: Publisher<ipc::Service, S, ()>,
    notifier: Notifier<ipc::Service>,
    event: event::PortFactory<ipc::Service>,
}

struct Iceoryx2Writer<S: Sample>(Indoors<WriteEnd<S>>);

impl<S: Sample> Writer<S> for Iceoryx2Writer<S> {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        let WriteEnd { publisher, notifier, event } = &*self.0;
        publisher.send_copy(*sample).map_err(failure(S::TOPIC))?;
        if event.dynamic_config().number_of_listeners() > 0 {
            // A listener that died meanwhile is no reason to stop.
            let _ = notifier.notify();
        }
        Ok(())
    }
}

struct ReadEnd<S: Sample> {
    subscriber: Subscriber<ipc::Service, S, ()>,
    listener: Option<Listener<ipc::Service>>,
}

struct Iceoryx2Reader<S: Sample>(Indoors<ReadEnd<S>>);

impl<S: Sample> Reader<S> for Iceoryx2Reader<S> {
    fn take(&mut self) -> Result<Option<S>, BusError> {
        let sample = self.0.subscriber.receive().map_err(failure(S::TOPIC))?;
        Ok(sample.map(|sample| *sample.payload()))
    }

    fn sleep(&mut self, until: Instant) -> Result<(), BusError> {
        let patience = until.saturating_duration_since(Instant::now());
        match &self.0.listener {
            None => thread::sleep(patience.min(STREAM_POLL)),
            Some(listener) => {
                wait_readable(listener, patience);
                // A signal may interrupt this; the caller looks for itself whether there is a sample.
                let _ = listener.try_wait(|_| {});
            }
        }
        Ok(())
    }

    fn has_more(&self) -> bool {
        self.0.subscriber.has_samples().unwrap_or(false)
    }

    fn malformed(&self) -> u64 {
        0 // Shared memory is typed: whoever disagrees about the layout cannot open the service.
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
