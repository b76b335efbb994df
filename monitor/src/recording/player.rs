//! A source that plays a recording.

use std::time::Instant;

use mtj_protocol::{bus::BusError, port::Message};

use super::{Recorded, Recording};
use crate::monitor::Source;

/// Plays a recording at any speed, from its beginning.
pub struct Player {
    recording: Recording,
    speed: f64,
    next: Option<Recorded>,
    start: Option<(Instant, u64)>,
    is_over: bool,
}

impl Player {
    /// Plays `speed` seconds of the recording in a second.
    pub fn new(recording: Recording, speed: f64) -> Self {
        Self { recording, speed, next: None, start: None, is_over: false }
    }

    /// Whether all was played.
    pub fn is_over(&self) -> bool {
        self.is_over
    }

    fn advance(&mut self) -> Result<(), BusError> {
        self.next = self.recording.next().transpose().map_err(BusError::Transport)?;
        self.is_over = self.next.is_none();
        Ok(())
    }
}

impl Source for Player {
    fn drain(&mut self, hear: &mut dyn FnMut(Message)) -> Result<(), BusError> {
        if self.start.is_none() {
            self.advance()?;
            self.start = self.next.as_ref().map(|first| (Instant::now(), first.log_time));
        }
        let Some((started, first)) = self.start else { return Ok(()) };
        let played = started.elapsed().mul_f64(self.speed).as_nanos();
        // What lies a little before its predecessor, as topics are emptied one after the other, is due
        // with it.
        while let Some(next) =
            self.next.take_if(|next| u128::from(next.log_time.saturating_sub(first)) <= played)
        {
            hear(next.message);
            self.advance()?;
        }
        Ok(())
    }
}
