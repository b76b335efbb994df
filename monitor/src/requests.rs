//! Sends requests from other threads to the plant and returns the plant's answers.

use std::{
    collections::VecDeque,
    fmt,
    sync::mpsc::{self, Receiver, Sender},
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::Bus,
    port::{Message, REPEAT, RequestPort, Unanswered},
    request::{Request, RequestError},
    sample::{ChangeSample, RequestSample},
};

use crate::{error::MonitorError, monitor::Sink};

/// How long a plant may take to answer.
const TIMEOUT: Duration = Duration::from_secs(3);

/// Why the plant did not answer a request.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoAnswer {
    /// No plant could carry it out.
    #[error(transparent)]
    Invalid(#[from] RequestError),
    /// No plant was heard yet.
    #[error("there is no plant in this session yet")]
    NoPlant,
    /// The answer did not come in time.
    #[error("{Unanswered}")]
    Unanswered,
    /// The monitor ends.
    #[error("the monitor is stopping")]
    Stopping,
}

/// The plant's answer to a request, or why there is none.
pub type Outcome = Result<ChangeSample, NoAnswer>;

type Reply = Box<dyn FnOnce(Outcome) + Send>;

/// Adds requests to a [`RequestQueue`], from any thread.
#[derive(Clone, Debug)]
pub struct RequestHandle(Sender<Incoming>);

struct Incoming {
    asked: Request,
    reply: Reply,
}

impl RequestHandle {
    /// Sends a request to the plant; `reply` is called once, on the monitor's thread.
    pub fn send(&self, asked: Request, reply: impl FnOnce(Outcome) + Send + 'static) {
        let incoming = Incoming { asked, reply: Box::new(reply) };
        if let Err(mpsc::SendError(Incoming { reply, .. })) = self.0.send(incoming) {
            reply(Err(NoAnswer::Stopping));
        }
    }
}

/// Sends the requests of its handles over the bus and repeats each until the plant answers.
pub struct RequestQueue {
    port: RequestPort,
    incoming: Receiver<Incoming>,
    sent: VecDeque<Sent>,
    run: Option<u64>,
}

struct Sent {
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
        let queue = Self { port, incoming, sent: VecDeque::new(), run: None };
        Ok((queue, RequestHandle(sender)))
    }
}

impl Sink for RequestQueue {
    fn handle(&mut self, message: &Message) {
        match message {
            Message::State(state) => self.run = Some(state.header.run),
            Message::Status(status) => self.run = Some(status.header.run),
            Message::Change(change) => {
                let is_answered = |entry: &Sent| entry.request.header.sequence == change.request;
                if let Some(index) = self.sent.iter().position(is_answered)
                    && let Some(entry) = self.sent.remove(index)
                {
                    (entry.reply)(Ok(*change));
                }
            }
            _ => {}
        }
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        let now = Instant::now();
        for Incoming { asked, reply } in self.incoming.try_iter() {
            match (asked.check(), self.run) {
                (Err(error), _) => reply(Err(error.into())),
                (Ok(()), None) => reply(Err(NoAnswer::NoPlant)),
                (Ok(()), Some(run)) => self.sent.push_back(Sent {
                    request: self.port.number(run, &asked),
                    reply,
                    repeat_at: now,
                    give_up_at: now + TIMEOUT,
                }),
            }
        }
        while self.sent.front().is_some_and(|entry| now >= entry.give_up_at) {
            if let Some(entry) = self.sent.pop_front() {
                (entry.reply)(Err(NoAnswer::Unanswered));
            }
        }
        for entry in self.sent.iter_mut().filter(|entry| now >= entry.repeat_at) {
            entry.repeat_at = now + REPEAT;
            self.port.send(&entry.request)?;
        }
        Ok(true)
    }
}
