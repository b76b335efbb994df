//! What is known of one role.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mtj_protocol::sample::PresenceSample;

/// What is known of the plant or of the leading controller.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoleStatus {
    /// When its newest message came.
    pub last_heard: Option<Instant>,
    /// When its first message came since it was last silent.
    since: Option<Instant>,
    /// Its newest presence sample: process, machine and when it joined.
    pub presence: Option<PresenceSample>,
}

impl RoleStatus {
    /// Notes that a message came; a pause longer than `silence_limit` counts as an interruption.
    pub(super) fn note_message(&mut self, silence_limit: Duration) {
        let now = Instant::now();
        if self.last_heard.is_none_or(|heard| now.duration_since(heard) > silence_limit) {
            self.since = Some(now);
        }
        self.last_heard = Some(now);
    }

    /// How long it has taken part: since it joined, by its own clock, or since its first message if
    /// that is longer ago.
    pub fn age(&self) -> Option<Duration> {
        let observed = self.since?.elapsed();
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let joined = self.presence.map(|presence| Duration::from_nanos(presence.since_ns));
        let by_its_clock = joined.and_then(|joined| now.checked_sub(joined));
        Some(by_its_clock.map_or(observed, |age| age.max(observed)))
    }

    /// The time since its newest message.
    pub fn silence(&self) -> Option<Duration> {
        self.last_heard.map(|heard| heard.elapsed())
    }
}
