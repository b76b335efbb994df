//! One session of a fleet.

use std::time::{Duration, Instant};

use mtj_protocol::{
    bus::Shared,
    port::{Message, MonitorPort},
    sample::{PresenceSample, text_of},
};

use super::table::Row;
use crate::{
    lines::Second,
    overview::{Overview, Phase},
};

/// What is known of a session.
pub struct Cell<B> {
    ears: Option<(B, MonitorPort)>,
    trouble: Option<String>,
    overview: Overview,
    second: Second,
    absent: Option<Instant>,
}

impl<B> Default for Cell<B> {
    fn default() -> Self {
        Self {
            ears: None,
            trouble: None,
            overview: Overview::default(),
            second: Second::default(),
            absent: None,
        }
    }
}

impl<B: Shared> Cell<B> {
    /// Listens from now on, if it does not yet. What stands in the way, one session's concern, is shown.
    pub fn join(&mut self, bus: &B, name: &str) {
        if self.ears.is_none() {
            let ears = bus.within(name).and_then(|bus| {
                let port = MonitorPort::open(&bus)?;
                Ok((bus, port))
            });
            self.trouble = ears.as_ref().err().map(ToString::to_string);
            self.ears = ears.ok();
        }
    }

    /// Takes note of whether anybody takes part.
    pub fn is_there(&mut self, is_there: bool) {
        self.absent = (!is_there).then(|| self.absent.unwrap_or_else(Instant::now));
    }

    /// For how long nobody has taken part.
    pub fn absence(&self) -> Option<Duration> {
        self.absent.map(|since| since.elapsed())
    }

    /// Takes in what was said since the last call.
    pub fn listen(&mut self) {
        let Some((bus, port)) = &mut self.ears else { return };
        let Self { overview, second, .. } = self;
        let heard = port.drain(bus, &mut |message| {
            overview.hear(&message);
            if let Message::Error(error) = message {
                second.add(&error);
            }
        });
        if let Err(error) = heard {
            self.ears = None;
            self.trouble = Some(error.to_string());
        }
    }

    /// How things stand; sums of a second begin anew.
    pub fn row(&mut self, name: &str) -> Row {
        let second = std::mem::take(&mut self.second);
        let overview = &self.overview;
        let status = overview.status.unwrap_or_default();
        Row {
            session: name.to_owned(),
            phase: match overview.phase() {
                _ if self.absent.is_some() => "gone",
                None => "-",
                Some(Phase::Waiting) => "waiting",
                Some(Phase::Running) => "running",
                Some(Phase::Finished) => "finished",
                Some(Phase::Paused) => "paused",
            },
            time: overview.time(),
            law: overview.law().map_or("-", |law| law.name),
            error: second.rms_error(),
            // One word, so that a column is a column to programs, too.
            gauge: second.gauge().map(|(symbol, mean)| format!("{symbol}={mean:.3}")),
            round_trip: overview.round_trips.spread(),
            in_charge: match (overview.leader(), &overview.controller().presence) {
                (None, _) => "-".to_owned(),
                (Some(_), None) => "?".to_owned(),
                (Some(_), Some(presence)) => place(presence),
            },
            standby: overview.standing_by(),
            counts: [
                status.lost,
                status.late,
                status.rejected,
                status.timeouts,
                status.takeovers,
                overview.missed,
            ],
            alarm: match (&self.trouble, self.absent) {
                (Some(trouble), _) => Some(trouble.clone()),
                (None, Some(_)) => Some("nobody takes part any more".to_owned()),
                (None, None) => overview.alarm().map(|alarm| alarm.sentence()),
            },
        }
    }
}

/// A process and its machine.
fn place(presence: &PresenceSample) -> String {
    let host: String = text_of(&presence.host).chars().filter(|c| c.is_ascii_graphic()).collect();
    format!("{}@{host}", presence.process)
}
