//! Leaves samples out on purpose: for smaller recordings, and for displays behind slow links.
//!
//! Scenarios, status, requests, changes and presence always pass. What is left out does not count
//! as missed.

use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use mtj_protocol::{port::Message, sample::Header};

use crate::{error::MonitorError, monitor::Sink};

/// A display gets an error sample at least this often: the sign that the controller answers.
const SIGN_OF_LIFE: Duration = Duration::from_millis(200);

/// Which samples a monitor shows and records.
#[derive(Args, Clone, Debug, Default)]
pub struct FilterOptions {
    /// Show and record only every N-th sample: state, torque and error of the same instants
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub every: Option<u64>,
    /// Show and record only these of state, torque and error; all other topics always pass
    #[arg(long, value_name = "TOPIC,TOPIC", value_delimiter = ',')]
    pub topics: Vec<SampleTopic>,
}

/// A topic with a message at each sampling instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SampleTopic {
    /// Plant to controller.
    State,
    /// Controller to plant.
    Torque,
    /// Controller to monitors.
    Error,
}

impl SampleTopic {
    /// Its name, as on the bus.
    fn name(self) -> &'static str {
        match self {
            Self::State => "state",
            Self::Torque => "torque",
            Self::Error => "error",
        }
    }
}

impl FilterOptions {
    /// The filter that they describe.
    pub fn filter(&self) -> Filter {
        Filter { every: self.every.unwrap_or(1).max(1), topics: self.topics.clone() }
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let every = self.every.map(|every| ["--every".to_owned(), every.to_string()]);
        let topics = (!self.topics.is_empty()).then(|| ["--topics".to_owned(), self.names()]);
        every.into_iter().chain(topics).flatten().collect()
    }

    fn names(&self) -> String {
        self.topics.iter().map(|topic| topic.name()).collect::<Vec<_>>().join(",")
    }
}

/// Decides which messages pass. By default all do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Filter {
    every: u64,
    /// The topics that pass; all if there are none.
    topics: Vec<SampleTopic>,
}

impl Default for Filter {
    fn default() -> Self {
        FilterOptions::default().filter()
    }
}

impl Filter {
    /// Whether a message passes: of the samples those whose number is a multiple of N.
    pub fn passes(&self, message: &Message) -> bool {
        sample(message).is_none_or(|(topic, header)| {
            let is_named = self.topics.is_empty() || self.topics.contains(&topic);
            is_named && header.sequence.is_multiple_of(self.every)
        })
    }

    /// Whether every message passes.
    pub fn passes_all(&self) -> bool {
        self == &Self::default()
    }

    /// What is left out, as entries of a recording's metadata.
    pub fn metadata(&self) -> Vec<(String, String)> {
        let names: Vec<_> = self.topics.iter().map(|topic| topic.name()).collect();
        let every = (self.every > 1).then(|| ("every".to_owned(), self.every.to_string()));
        let topics = (!names.is_empty()).then(|| ("topics".to_owned(), names.join(",")));
        every.into_iter().chain(topics).collect()
    }

    /// Puts the filter before displays.
    pub fn before<'a>(&self, displays: Vec<Box<dyn Sink + 'a>>) -> Vec<Box<dyn Sink + 'a>> {
        if self.passes_all() {
            return displays;
        }
        let filtered = |display| -> Box<dyn Sink + 'a> {
            Box::new(FilteredDisplay::new(self.clone(), display))
        };
        displays.into_iter().map(filtered).collect()
    }
}

/// The topic and the header of a sample that a filter may leave out.
fn sample(message: &Message) -> Option<(SampleTopic, &Header)> {
    match message {
        Message::State(state) => Some((SampleTopic::State, &state.header)),
        Message::Torque(torque) => Some((SampleTopic::Torque, &torque.header)),
        Message::Error(error) => Some((SampleTopic::Error, &error.header)),
        _ => None,
    }
}

/// A display with a filter before it.
///
/// The display sees a session whose sample period is N times as long: its samples are numbered
/// without gaps, so that a gap is a sample that never came. Some of the errors that are left out
/// pass as well, so that the controller is not taken for silent.
struct FilteredDisplay<'a> {
    filter: Filter,
    display: Box<dyn Sink + 'a>,
    /// When the display got its newest error.
    newest_error: Option<Instant>,
}

impl<'a> FilteredDisplay<'a> {
    fn new(filter: Filter, display: Box<dyn Sink + 'a>) -> Self {
        Self { filter, display, newest_error: None }
    }

    fn passes(&mut self, message: &Message) -> bool {
        let passes = self.filter.passes(message);
        if !matches!(message, Message::Error(_)) {
            return passes;
        }
        let is_due = self.newest_error.is_none_or(|at| at.elapsed() > SIGN_OF_LIFE);
        if passes || is_due {
            self.newest_error = Some(Instant::now());
        }
        passes || is_due
    }
}

impl Sink for FilteredDisplay<'_> {
    fn handle(&mut self, message: &Message) {
        if self.passes(message) {
            self.display.handle(&renumbered(message, self.filter.every));
        }
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        self.display.refresh()
    }
}

/// The message with its number among those that pass.
fn renumbered(message: &Message, every: u64) -> Message {
    let mut message = message.clone();
    match &mut message {
        Message::State(state) => state.header.sequence /= every,
        Message::Torque(torque) => torque.header.sequence /= every,
        Message::Error(error) => error.header.sequence /= every,
        _ => {}
    }
    message
}
