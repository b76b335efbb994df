//! Under which names messages are recorded.

use mtj_protocol::{
    port::Message,
    sample::{
        ChangeSample, ErrorSample, Field, Header, PresenceSample, RequestSample, Sample,
        StateSample, StatusSample, TorqueSample,
    },
};

/// The topic of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// The scenario of a run, or one that was changed.
    Scenario,
    /// Plant to controller.
    State,
    /// Controller to plant.
    Torque,
    /// Controller to monitors.
    Error,
    /// Plant to monitors.
    Status,
    /// Operator to plant.
    Request,
    /// Plant to all: the answer to a request.
    Change,
    /// Each role to all.
    Presence,
}

/// All topics, in the order of their numbers.
pub const TOPICS: [Topic; 8] = [
    Topic::Scenario,
    Topic::State,
    Topic::Torque,
    Topic::Error,
    Topic::Status,
    Topic::Request,
    Topic::Change,
    Topic::Presence,
];

/// One number for each topic.
pub(crate) type Counts = [u64; TOPICS.len()];

/// Counts as words: "1 scenario, 300 state, …".
pub(super) fn counts_in_words(counts: &Counts) -> String {
    TOPICS.map(|topic| format!("{} {}", counts[topic as usize], topic.name())).join(", ")
}

impl Topic {
    /// A message's topic.
    pub fn of(message: &Message) -> Self {
        match message {
            Message::Scenario(_) => Self::Scenario,
            Message::State(_) => Self::State,
            Message::Torque(_) => Self::Torque,
            Message::Error(_) => Self::Error,
            Message::Status(_) => Self::Status,
            Message::Request(_) => Self::Request,
            Message::Change(_) => Self::Change,
            Message::Presence(_) => Self::Presence,
        }
    }

    /// Its name, as on the bus.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scenario => "scenario",
            Self::State => StateSample::TOPIC,
            Self::Torque => TorqueSample::TOPIC,
            Self::Error => ErrorSample::TOPIC,
            Self::Status => StatusSample::TOPIC,
            Self::Request => RequestSample::TOPIC,
            Self::Change => ChangeSample::TOPIC,
            Self::Presence => PresenceSample::TOPIC,
        }
    }

    /// The channel in a recording. The session is not part of it, so that the layout of a viewer
    /// fits all recordings; the metadata name the session.
    pub fn channel(self) -> String {
        format!("/mtj/{}", self.name())
    }

    /// The topic of a channel.
    pub fn of_channel(channel: &str) -> Option<Self> {
        let name = channel.strip_prefix("/mtj/")?;
        TOPICS.into_iter().find(|topic| topic.name() == name)
    }
}

/// The header of a message; a scenario has none.
pub fn header(message: &Message) -> Option<&Header> {
    Some(match message {
        Message::Scenario(_) => return None,
        Message::State(sample) => &sample.header,
        Message::Torque(sample) => &sample.header,
        Message::Error(sample) => &sample.header,
        Message::Status(sample) => &sample.header,
        Message::Request(sample) => &sample.header,
        Message::Change(sample) => &sample.header,
        Message::Presence(sample) => &sample.header,
    })
}

/// Passes each field after the header to `show`.
pub fn fields(message: &Message, show: &mut dyn FnMut(&'static str, Field<'_>)) {
    match message {
        Message::Scenario(offered) => {
            show("name", Field::Text(&offered.scenario.name));
            show("run", Field::Count(offered.run));
            show("revision", Field::Count(u64::from(offered.revision)));
            show("text", Field::Text(offered.scenario.text()));
        }
        Message::State(sample) => sample.fields(show),
        Message::Torque(sample) => sample.fields(show),
        Message::Error(sample) => sample.fields(show),
        Message::Status(sample) => sample.fields(show),
        Message::Request(sample) => sample.fields(show),
        Message::Change(sample) => sample.fields(show),
        Message::Presence(sample) => sample.fields(show),
    }
}
