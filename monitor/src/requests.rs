//! Sends requests from other threads to the plant and returns the plant's answers.

use std::{
    collections::VecDeque,
    fmt,
    sync::mpsc::{self, Receiver, Sender},
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::Bus,
    knob::Knob,
    port::{Message, REPEAT, RequestPort, UNANSWERED},
    sample::{ChangeSample, RequestSample},
};

use crate::{error::MonitorError, monitor::Sink};

/// How long a plant may take to answer.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Why the plant did not answer a request.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// No plant could carry it out.
    #[error("{0}")]
    Invalid(String),
    /// No plant was heard yet.
    #[error("there is no plant in this session yet")]
    NoPlant,
    /// The answer did not come in time.
    #[error("{UNANSWERED}")]
    Unanswered,
    /// The monitor ends.
    #[error("the monitor is stopping")]
    Stopping,
}

/// The plant's answer to a request, or why there is none.
pub type Outcome = Result<ChangeSample, RequestError>;

type Reply = Box<dyn FnOnce(Outcome) + Send>;

/// Adds requests to a [`RequestQueue`], from any thread.
#[derive(Clone, Debug)]
pub struct RequestHandle(Sender<Incoming>);

struct Incoming {
    knob: Knob,
    reply: Reply,
}

impl RequestHandle {
    /// Sends a request to the plant; `reply` is called once, on the monitor's thread.
    pub fn send(&self, knob: Knob, reply: impl FnOnce(Outcome) + Send + 'static) {
        let incoming = Incoming { knob, reply: Box::new(reply) };
        if let Err(mpsc::SendError(Incoming { reply, .. })) = self.0.send(incoming) {
            reply(Err(RequestError::Stopping));
        }
    }
}

/// Sends the requests of its handles over the bus and repeats each until the plant answers.
pub struct RequestQueue {
    port: RequestPort,
    incoming: Receiver<Incoming>,
    unanswered: VecDeque<Unanswered>,
    run: Option<u64>,
}

struct Unanswered {
    request: RequestSample,
    reply: Reply,
    repeat_at: Instant,
    give_up_at: Instant,
}

impl fmt::Debug for RequestQueue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RequestQueue").field("run", &self.run).finish_non_exhaustive()
    }
}

impl RequestQueue {
    /// A queue on a bus, and a handle to it.
    pub fn open(bus: &impl Bus) -> Result<(Self, RequestHandle), MonitorError> {
        let (sender, incoming) = mpsc::channel();
        let port = RequestPort::open(bus)?;
        let queue = Self { port, incoming, unanswered: VecDeque::new(), run: None };
        Ok((queue, RequestHandle(sender)))
    }
}

impl Sink for RequestQueue {
    fn handle(&mut self, message: &Message) {
        match message {
            Message::State(state) => self.run = Some(state.header.run),
            Message::Status(status) => self.run = Some(status.header.run),
            Message::Change(change) => {
                let is_answered =
                    |entry: &Unanswered| entry.request.header.sequence == change.request;
                if let Some(index) = self.unanswered.iter().position(is_answered)
                    && let Some(entry) = self.unanswered.remove(index)
                {
                    (entry.reply)(Ok(*change));
                }
            }
            _ => {}
        }
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        let now = Instant::now();
        for Incoming { knob, reply } in self.incoming.try_iter() {
            match (knob.fault(), self.run) {
                (Some(fault), _) => reply(Err(RequestError::Invalid(fault))),
                (None, None) => reply(Err(RequestError::NoPlant)),
                (None, Some(run)) => self.unanswered.push_back(Unanswered {
                    request: self.port.prepare(run, &knob),
                    reply,
                    repeat_at: now,
                    give_up_at: now + TIMEOUT,
                }),
            }
        }
        while self.unanswered.front().is_some_and(|entry| now >= entry.give_up_at) {
            if let Some(entry) = self.unanswered.pop_front() {
                (entry.reply)(Err(RequestError::Unanswered));
            }
        }
        for entry in self.unanswered.iter_mut().filter(|entry| now >= entry.repeat_at) {
            entry.repeat_at = now + REPEAT;
            self.port.send(&entry.request)?;
        }
        Ok(true)
    }
}
