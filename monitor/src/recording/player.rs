//! A source that plays a recording.

use std::time::Instant;

use mtj_protocol::{bus::BusError, port::Message};

use super::{Recorded, Recording};
use crate::monitor::Source;

/// Plays a recording at any speed, from its beginning; says so at its end, and stays silent then.
pub struct Player {
    recording: Recording,
    speed: f64,
    next: Option<Recorded>,
    start: Option<(Instant, u64)>,
}

impl Player {
    /// Plays `speed` seconds of the recording in a second.
    pub fn new(recording: Recording, speed: f64) -> Self {
        Self { recording, speed, next: None, start: None }
    }

    fn advance(&mut self) -> Result<(), BusError> {
        self.next =
            self.recording.next().transpose().map_err(|error| BusError::Transport(error.into()))?;
        if self.next.is_none() {
            eprintln!("mtj: the recording has been played to its end");
        }
        Ok(())
    }
}

impl Source for Player {
    fn drain(&mut self, hear: &mut dyn FnMut(Message)) -> Result<(), BusError> {
        let (started, first) = match self.start {
            Some(start) => start,
            None => {
                self.advance()?;
                let first = self.next.as_ref().map_or(0, |first| first.log_time);
                *self.start.insert((Instant::now(), first))
            }
        };
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
