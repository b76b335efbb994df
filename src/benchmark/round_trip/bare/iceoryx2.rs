//! iceoryx2's publish-subscribe, as in its own benchmark of it; with an event beside it where the
//! ends block.

use std::time::{Duration, Instant};

use iceoryx2::{
    port::{listener::Listener, notifier::Notifier, publisher::Publisher, subscriber::Subscriber},
    prelude::*,
    service::port_factory::{event, publish_subscribe},
};
use mtj_model::scenario::Wait;
use mtj_plant::durations::Durations;
use mtj_protocol::sample::{StateSample, TorqueSample};

use super::{WARM_UP, Way};
use crate::failure::Failure;

/// How long to wait for an answer before the other process counts as gone.
const GONE: Duration = Duration::from_secs(5);
/// How long a listener sleeps before it looks whether to go on.
const LOOK: Duration = Duration::from_millis(50);
/// How often one who spins looks at anything but the next sample.
const LOOKS: u32 = 1024;

/// Sends states and takes torques.
pub fn ping(place: &str, way: Way, samples: u64) -> Result<Durations, Failure> {
    let node = node()?;
    let there = Sender::<StateSample>::open(&node, place, "there", way.wait)?;
    let back = Receiver::<TorqueSample>::open(&node, place, "back", way.wait)?;
    let mut trips = Durations::default();
    // The other process may still be on its way: the first sample is repeated until it is answered.
    let end = Instant::now() + GONE;
    while back.receive(Instant::now() + LOOK)?.is_none() {
        if Instant::now() >= end {
            return Err(Failure::other("no answer over bare iceoryx2"));
        }
        there.send(&StateSample::default())?;
    }
    while back.receive(Instant::now() + LOOK)?.is_some() {}
    let mut due = Instant::now();
    for k in 0..WARM_UP + samples {
        if let Some(period) = way.period() {
            due += period;
            while Instant::now() < due {
                std::hint::spin_loop();
            }
        }
        let mut state = StateSample::default();
        state.header.sequence = k;
        let began = Instant::now();
        there.send(&state)?;
        let Some(_) = back.receive(began + GONE)? else {
            return Err(Failure::other("the answers over bare iceoryx2 ceased"));
        };
        let took = began.elapsed();
        if k >= WARM_UP {
            trips.record(took.as_nanos() as u64);
        }
    }
    Ok(trips)
}

/// Answers each state with a torque.
pub fn pong(place: &str, wait: Wait, proceed: &dyn Fn() -> bool) -> Result<(), Failure> {
    let node = node()?;
    let there = Receiver::<StateSample>::open(&node, place, "there", wait)?;
    let back = Sender::<TorqueSample>::open(&node, place, "back", wait)?;
    while proceed() {
        while let Some(state) = there.receive(Instant::now() + LOOK)? {
            back.send(&TorqueSample { header: state.header, ..TorqueSample::default() })?;
        }
    }
    Ok(())
}

/// A node apart from all others of this machine; it clears away after those of its kind that died.
fn node() -> Result<Node<ipc::Service>, Failure> {
    set_log_level_from_env_or(LogLevel::Fatal);
    let mut config = Config::default();
    config.global.prefix = FileName::new(b"mtj_bare_").map_err(failure)?;
    NodeBuilder::new().config(&config).create().map_err(failure)
}

struct Sender<S: std::fmt::Debug + ZeroCopySend + Copy + 'static> {
    publisher: Publisher<ipc::Service, S, ()>,
    notifier: Option<Notifier<ipc::Service>>,
}

struct Receiver<S: std::fmt::Debug + ZeroCopySend + Copy + 'static> {
    subscriber: Subscriber<ipc::Service, S, ()>,
    listener: Option<Listener<ipc::Service>>,
}

type Samples<S> = publish_subscribe::PortFactory<ipc::Service, S, ()>;
type Events = event::PortFactory<ipc::Service>;

/// A topic, and its event where the ends do not spin.
fn services<S: std::fmt::Debug + ZeroCopySend + Copy + 'static>(
    node: &Node<ipc::Service>,
    place: &str,
    topic: &str,
    wait: Wait,
) -> Result<(Samples<S>, Option<Events>), Failure> {
    let name = ServiceName::new(&format!("mtj-bare/{place}/{topic}")).map_err(failure)?;
    let samples = node.service_builder(&name).publish_subscribe::<S>().open_or_create();
    let events = match wait {
        Wait::Spin => None,
        Wait::Block | Wait::Hybrid(_) => {
            Some(node.service_builder(&name).event().open_or_create().map_err(failure)?)
        }
    };
    Ok((samples.map_err(failure)?, events))
}

impl<S: std::fmt::Debug + ZeroCopySend + Copy + 'static> Sender<S> {
    fn open(
        node: &Node<ipc::Service>,
        place: &str,
        topic: &str,
        wait: Wait,
    ) -> Result<Self, Failure> {
        let (samples, events) = services::<S>(node, place, topic, wait)?;
        let publisher = samples.publisher_builder().create().map_err(failure)?;
        let notifier = events.map(|events| events.notifier_builder().create()).transpose();
        let notifier = notifier.map_err(failure)?;
        Ok(Self { publisher, notifier })
    }

    fn send(&self, sample: &S) -> Result<(), Failure> {
        self.publisher.send_copy(*sample).map_err(failure)?;
        if let Some(notifier) = &self.notifier {
            notifier.notify().map_err(failure)?;
        }
        Ok(())
    }
}

impl<S: std::fmt::Debug + ZeroCopySend + Copy + 'static> Receiver<S> {
    fn open(
        node: &Node<ipc::Service>,
        place: &str,
        topic: &str,
        wait: Wait,
    ) -> Result<Self, Failure> {
        let (samples, events) = services::<S>(node, place, topic, wait)?;
        let subscriber = samples.subscriber_builder().create().map_err(failure)?;
        let listener = events.map(|events| events.listener_builder().create()).transpose();
        let listener = listener.map_err(failure)?;
        Ok(Self { subscriber, listener })
    }

    fn receive(&self, until: Instant) -> Result<Option<S>, Failure> {
        loop {
            for _ in 0..LOOKS {
                if let Some(sample) = self.subscriber.receive().map_err(failure)? {
                    return Ok(Some(*sample.payload()));
                }
                if let Some(listener) = &self.listener {
                    listener.timed_wait(|_| {}, LOOK).map_err(failure)?;
                    break;
                }
                std::hint::spin_loop();
            }
            if Instant::now() >= until {
                return Ok(None);
            }
        }
    }
}

fn failure(error: impl std::fmt::Debug) -> Failure {
    Failure::other(format_args!("bare iceoryx2: {error:?}"))
}
