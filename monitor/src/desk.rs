//! Takes knob turns from other threads to the plant, and the plant's answers back.

use std::{
    collections::VecDeque,
    sync::mpsc::{self, Receiver, Sender},
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::{Bus, BusError},
    port::{Message, REPEAT, RequestPort, Unanswered},
    request::Request,
    sample::{ChangeSample, RequestSample},
};

use crate::monitor::Audience;

/// How long a plant may take to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// What becomes of a knob that was turned: the plant's answer, or why there is none.
pub type Outcome = Result<ChangeSample, String>;

type Reply = Box<dyn FnOnce(Outcome) + Send>;

/// Where knobs are handed in, from any thread.
#[derive(Clone)]
pub struct Counter(Sender<(Request, Reply)>);

impl Counter {
    /// Asks the plant to turn a knob; `reply` is called once, on the monitor's thread.
    pub fn turn(&self, knob: Request, reply: impl FnOnce(Outcome) + Send + 'static) {
        if let Err(mpsc::SendError((_, reply))) = self.0.send((knob, Box::new(reply))) {
            reply(Err("the monitor is stopping".to_owned()));
        }
    }
}

/// Carries requests between the counter and the bus.
pub struct Desk {
    port: RequestPort,
    orders: Receiver<(Request, Reply)>,
    waiting: VecDeque<Waiting>,
    run: Option<u64>,
}

struct Waiting {
    request: RequestSample,
    reply: Reply,
    again: Instant,
    until: Instant,
}

impl Desk {
    /// A desk on a bus, and the counter before it.
    pub fn open(bus: &impl Bus) -> Result<(Self, Counter), BusError> {
        let (sender, orders) = mpsc::channel();
        let port = RequestPort::open(bus)?;
        Ok((Self { port, orders, waiting: VecDeque::new(), run: None }, Counter(sender)))
    }
}

impl Audience for Desk {
    fn hear(&mut self, message: &Message) {
        match message {
            Message::State(state) => self.run = Some(state.header.run),
            Message::Status(status) => self.run = Some(status.header.run),
            Message::Change(change) => {
                let answered =
                    |waiting: &Waiting| waiting.request.header.sequence == change.request;
                if let Some(place) = self.waiting.iter().position(answered)
                    && let Some(waiting) = self.waiting.remove(place)
                {
                    (waiting.reply)(Ok(*change));
                }
            }
            _ => {}
        }
    }

    fn refresh(&mut self) -> Result<bool, BusError> {
        let now = Instant::now();
        for (knob, reply) in self.orders.try_iter() {
            match (knob.check(), self.run) {
                (Err(error), _) => reply(Err(error.to_string())),
                (Ok(()), None) => reply(Err("there is no plant in this session yet".to_owned())),
                (Ok(()), Some(run)) => {
                    let request = self.port.number(run, &knob);
                    self.waiting.push_back(Waiting {
                        request,
                        reply,
                        again: now,
                        until: now + PATIENCE,
                    });
                }
            }
        }
        while self.waiting.front().is_some_and(|waiting| now >= waiting.until) {
            if let Some(late) = self.waiting.pop_front() {
                (late.reply)(Err(Unanswered.to_string()));
            }
        }
        for waiting in self.waiting.iter_mut().filter(|waiting| now >= waiting.again) {
            waiting.again = now + REPEAT;
            self.port.send(&waiting.request)?;
        }
        Ok(true)
    }
}
