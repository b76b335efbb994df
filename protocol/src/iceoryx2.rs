//! The bus over iceoryx2: zero-copy shared memory between the processes of one machine.
//!
//! Each topic is a publish-subscribe service `mtj/<session>/<topic>`. A loop's reader has a buffer
//! of one with safe overflow, so the newest sample wins; a stream's reader has a deep one. Readers
//! that block have a listener beside it, and writers notify only while there is one, so a spinning
//! loop makes no system calls. The scenario is a service of bytes with a history of one.

use std::{
    any::Any,
    cell::RefCell,
    fmt::Debug,
    os::fd::BorrowedFd,
    thread,
    time::{Duration, Instant},
};

use iceoryx2::{
    node::NodeView,
    port::{
        listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber,
        update_connections::UpdateConnections,
    },
    prelude::*,
    service::port_factory::{event, publish_subscribe},
};
use mtj_model::scenario::Wait;
use nix::poll::{PollFd, PollFlags, ppoll};

use crate::{
    bus::{
        self, Attendance, Bus, BusError, Depth, Offering, RECENT_DEPTH, Reader, STREAM_DEPTH,
        Writer,
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
    node: Node<ipc::Service>,
    /// Last, because fields are dropped in order: it sweeps when the last node has gone.
    _broom: Broom,
}

/// Sweeps our domain of shared memory when a bus is gone.
struct Broom(Box<Config>);

impl Drop for Broom {
    fn drop(&mut self) {
        sweep(&self.0);
    }
}

#[derive(Default)]
struct Offers {
    subscriber: Option<Subscriber<ipc::Service, [u8], ()>>,
    newest: Option<Vec<u8>>,
}

impl Iceoryx2Bus {
    /// Joins the session, after clearing away what dead processes left behind.
    pub fn open(session: &str) -> Result<Self, BusError> {
        set_log_level_from_env_or(LogLevel::Fatal);
        // A domain of our own, apart from other programs that use iceoryx2.
        let mut config = Config::global_config().clone();
        config.global.prefix = FileName::new(b"mtj_").map_err(failure("the domain's name"))?;
        let node = node(&config, None)?;
        Ok(Self {
            offers: RefCell::default(),
            session: session.to_owned(),
            node,
            _broom: Broom(Box::new(config)),
        })
    }

    fn name(&self, topic: &str) -> Result<ServiceName, BusError> {
        ServiceName::new(&format!("mtj/{}/{topic}", self.session))
            .map_err(failure("the session's name"))
    }

    fn service<S: Sample>(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, S, ()>, BusError> {
        self.node
            .service_builder(&self.name(S::TOPIC)?)
            .publish_subscribe::<S>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(STREAM_DEPTH)
            .subscriber_max_borrowed_samples(1)
            .history_size(0)
            .max_publishers(if S::ONE_WRITER { 1 } else { MAX_WRITERS })
            .max_subscribers(MAX_READERS)
            .max_nodes(MAX_NODES)
            .open_or_create()
            .map_err(failure(S::TOPIC))
    }

    fn event_service(&self, topic: &str) -> Result<event::PortFactory<ipc::Service>, BusError> {
        self.node
            .service_builder(&self.name(topic)?)
            .event()
            .max_listeners(MAX_READERS)
            .max_notifiers(MAX_WRITERS)
            .max_nodes(MAX_NODES)
            .open_or_create()
            .map_err(failure(topic))
    }

    fn offer_service(
        &self,
    ) -> Result<publish_subscribe::PortFactory<ipc::Service, [u8], ()>, BusError> {
        self.node
            .service_builder(&self.name("scenario")?)
            .publish_subscribe::<[u8]>()
            .enable_safe_overflow(true)
            .history_size(1)
            .subscriber_max_buffer_size(1)
            .subscriber_max_borrowed_samples(1)
            .max_publishers(1)
            .max_subscribers(MAX_NODES)
            .max_nodes(MAX_NODES)
            .open_or_create()
            .map_err(failure("scenario"))
    }

    fn writer_of<S: Sample>(&self) -> Result<Iceoryx2Writer<S>, BusError> {
        let publisher = self
            .service::<S>()?
            .publisher_builder()
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|error| taken(&self.session, S::TOPIC, &error))?;
        let event = self.event_service(S::TOPIC)?;
        let notifier = event.notifier_builder().create().map_err(failure(S::TOPIC))?;
        Ok(Iceoryx2Writer { publisher, notifier, event })
    }
}

impl Bus for Iceoryx2Bus {
    fn writer<S: Sample>(&self) -> Result<Box<dyn Writer<S>>, BusError> {
        Ok(Box::new(self.writer_of()?))
    }

    fn reader<S: Sample>(&self, depth: Depth, wait: Wait) -> Result<Box<dyn Reader<S>>, BusError> {
        let buffer = match depth {
            Depth::Latest => 1,
            Depth::Recent => RECENT_DEPTH,
            Depth::Stream => STREAM_DEPTH,
        };
        let subscriber = self
            .service::<S>()?
            .subscriber_builder()
            .buffer_size(buffer)
            .create()
            .map_err(failure(S::TOPIC))?;
        let listener = match (depth, wait) {
            (Depth::Latest | Depth::Recent, Wait::Block) => {
                let event = self.event_service(S::TOPIC)?;
                Some(event.listener_builder().create().map_err(failure(S::TOPIC))?)
            }
            _ => None,
        };
        Ok(Box::new(Iceoryx2Reader { subscriber, listener }))
    }

    fn offer(&self, bytes: Vec<u8>) -> Result<Box<dyn Offering>, BusError> {
        let publisher = self
            .offer_service()?
            .publisher_builder()
            .initial_max_slice_len(MAX_OFFER)
            .create()
            .map_err(|error| taken(&self.session, "scenario", &error))?;
        let mut offer = Iceoryx2Offer(publisher);
        offer.renew(bytes)?;
        Ok(Box::new(offer))
    }

    fn fetch(&self) -> Result<Option<Vec<u8>>, BusError> {
        let mut offers = self.offers.borrow_mut();
        if offers.subscriber.is_none() {
            let service = self.offer_service()?;
            let subscriber = service.subscriber_builder().create().map_err(failure("scenario"))?;
            offers.subscriber = Some(subscriber);
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
        // A node of its own, because a node gets its name when it is made; iceoryx2 watches over nodes.
        let name = format!("mtj/{}/{member}", self.session);
        let node = node(self.node.config(), Some(&name))?;
        Ok(Box::new(node))
    }

    fn attendance(&self) -> Result<Box<dyn Attendance>, BusError> {
        let prefix = format!("mtj/{}/", self.session);
        Ok(Box::new(Nodes { config: Box::new(self.node.config().clone()), prefix }))
    }
}

/// The nodes whose names begin with `prefix`.
struct Nodes {
    config: Box<Config>,
    prefix: String,
}

impl Attendance for Nodes {
    fn present(&mut self) -> Result<Vec<Member>, BusError> {
        let mut members = Vec::new();
        Node::<ipc::Service>::list(&self.config, |node| {
            if let NodeState::Alive(node) = node
                && let Some(details) = node.details()
                && let Some(Ok(member)) =
                    details.name().as_str().strip_prefix(&self.prefix).map(str::parse)
            {
                members.push(member);
            }
            CallbackProgression::Continue
        })
        .map_err(failure("the nodes could not be listed"))?;
        Ok(members)
    }
}

fn node(config: &Config, name: Option<&str>) -> Result<Node<ipc::Service>, BusError> {
    let mut builder =
        NodeBuilder::new().config(config).signal_handling_mode(SignalHandlingMode::Disabled);
    if let Some(name) = name {
        builder = builder.name(&NodeName::new(name).map_err(failure("a node's name"))?);
    }
    builder.create().map_err(failure("shared memory could not be opened"))
}

struct Iceoryx2Writer<S: Sample> {
    publisher: Publisher<ipc::Service, S, ()>,
    notifier: Notifier<ipc::Service>,
    event: event::PortFactory<ipc::Service>,
}

impl<S: Sample> Writer<S> for Iceoryx2Writer<S> {
    fn write(&mut self, sample: &S) -> Result<(), BusError> {
        self.publisher.send_copy(*sample).map_err(failure(S::TOPIC))?;
        if self.event.dynamic_config().number_of_listeners() > 0 {
            // A listener that died meanwhile is no reason to stop.
            let _ = self.notifier.notify();
        }
        Ok(())
    }
}

struct Iceoryx2Reader<S: Sample> {
    subscriber: Subscriber<ipc::Service, S, ()>,
    listener: Option<Listener<ipc::Service>>,
}

impl<S: Sample> Reader<S> for Iceoryx2Reader<S> {
    fn take(&mut self) -> Result<Option<S>, BusError> {
        let sample = self.subscriber.receive().map_err(failure(S::TOPIC))?;
        Ok(sample.map(|sample| *sample.payload()))
    }

    fn sleep(&mut self, until: Instant) -> Result<(), BusError> {
        let patience = until.saturating_duration_since(Instant::now());
        match &self.listener {
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
        self.subscriber.has_samples().unwrap_or(false)
    }

    fn malformed(&self) -> u64 {
        0 // Shared memory is typed: whoever disagrees about the layout cannot open the service.
    }
}

struct Iceoryx2Offer(Publisher<ipc::Service, [u8], ()>);

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

/// Removes the node counter that iceoryx2 leaves in shared memory, once no process uses it.
#[expect(unsafe_code, reason = "iceoryx2 has no other call for it")]
fn sweep(config: &Config) {
    // Dead nodes use nothing. Some stay listed: a node killed while its remains were cleared away has
    // lost the file that tells iceoryx2 our domain, and is sought in the default one from then on.
    let mut is_in_use = false;
    let listed = Node::<ipc::Service>::list(config, |node| {
        is_in_use |= !matches!(node, NodeState::Dead(_));
        CallbackProgression::Continue
    });
    if listed.is_ok() && !is_in_use {
        // SAFETY: no node is left in our domain. Should one start at this moment, it keeps the
        // segment it has mapped, and node ids stay unique by their process ids.
        let _ = unsafe { iceoryx2::testing::remove_global_mgmt_segment::<ipc::Service>(config) };
    }
}

fn failure<E: Debug>(what: &str) -> impl FnOnce(E) -> BusError {
    move |error| BusError::Transport(format!("iceoryx2, {what}: {error:?}"))
}

/// A second writer on a topic for one: somebody else already plays this role.
fn taken(
    session: &str,
    topic: &str,
    error: &iceoryx2::port::publisher::PublisherCreateError,
) -> BusError {
    use iceoryx2::port::publisher::PublisherCreateError as E;
    match error {
        E::ExceedsMaxSupportedPublishers => BusError::Settings(format!(
            "session '{session}' has as many processes that write '{topic}' as it may have; stop one, \
             or choose another name with --session"
        )),
        error => bus::BusError::Transport(format!("iceoryx2, {topic}: {error:?}")),
    }
}
