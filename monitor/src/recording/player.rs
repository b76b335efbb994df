//! A source that plays a recording.

use std::time::Instant;

use mtj_protocol::port::Message;
use tracing::info;

use super::{RecordedMessage, Recording, RecordingError};
use crate::{error::MonitorError, monitor::Source};

/// Plays a recording from its beginning at any speed; after its end there are no more messages.
#[derive(Debug)]
pub struct Player {
    recording: Recording,
    speed: f64,
    next: Option<RecordedMessage>,
    start: Option<(Instant, u64)>,
}

impl Player {
    /// Plays `speed` seconds of the recording in a second.
    pub fn new(recording: Recording, speed: f64) -> Self {
        Self { recording, speed, next: None, start: None }
    }

    fn advance(&mut self) -> Result<(), RecordingError> {
        self.next = self.recording.next().transpose()?;
        if self.next.is_none() {
            info!("the recording has been played to its end");
        }
        Ok(())
    }
}

impl Source for Player {
    fn drain(&mut self, handle: &mut dyn FnMut(Message)) -> Result<(), MonitorError> {
        let (started, first) = match self.start {
            Some(start) => start,
            None => {
                self.advance()?;
                let first = self.next.as_ref().map_or(0, |first| first.log_time);
                *self.start.insert((Instant::now(), first))
            }
        };
        let played = started.elapsed().mul_f64(self.speed).as_nanos();
        // Topics are recorded one after the other, so a message may have an earlier time than the
        // one before; it is played together with that one.
        while let Some(next) =
            self.next.take_if(|next| u128::from(next.log_time.saturating_sub(first)) <= played)
        {
            handle(next.message);
            self.advance()?;
        }
        Ok(())
    }
}
