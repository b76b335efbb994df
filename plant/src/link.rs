//! One direction between plant and controller: how long what enters it travels.

use std::time::Duration;

use mtj_model::scenario::LinkSettings;

/// A link that delays what it carries.
///
/// It belongs to the plant's agenda, so that it works the same under both clocks and over any bus.
#[derive(Clone, Debug)]
pub struct Link {
    latency: Duration,
}

impl Link {
    /// The link that the settings describe.
    pub fn new(settings: &LinkSettings) -> Self {
        Self { latency: settings.latency }
    }

    /// How long the next thing travels; `None` if it is lost.
    pub fn transit(&mut self) -> Option<Duration> {
        Some(self.latency)
    }
}
