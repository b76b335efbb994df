//! One session of a fleet.

use std::time::{Duration, Instant};

use mtj_protocol::{
    bus::Shared,
    port::{Message, MonitorPort},
    sample::{Phase, PresenceSample, text_of},
};

use super::table::SessionRow;
use crate::{error::MonitorError, lines::SecondSummary, overview::Overview};

/// Listens to one session and summarizes it.
pub(super) struct SessionMonitor<B> {
    port: Option<(B, MonitorPort)>,
    error: Option<MonitorError>,
    overview: Overview,
    second: SecondSummary,
    absent_since: Option<Instant>,
}

impl<B> Default for SessionMonitor<B> {
    fn default() -> Self {
        Self {
            port: None,
            error: None,
            overview: Overview::default(),
            second: SecondSummary::default(),
            absent_since: None,
        }
    }
}

impl<B: Shared> SessionMonitor<B> {
    /// Joins the session unless that is done. An error is shown in the session's row: the other
    /// sessions go on.
    pub(super) fn join(&mut self, bus: &B, name: &str) {
        if self.port.is_none() {
            let port = bus.within(name).and_then(|bus| {
                let port = MonitorPort::open(&bus)?;
                Ok((bus, port))
            });
            match port {
                Ok(port) => (self.port, self.error) = (Some(port), None),
                Err(error) => self.error = Some(error.into()),
            }
        }
    }

    /// Notes whether the session has members.
    pub(super) fn set_present(&mut self, is_present: bool) {
        self.absent_since = (!is_present).then(|| self.absent_since.unwrap_or_else(Instant::now));
    }

    /// For how long the session has had no members.
    pub(super) fn absence(&self) -> Option<Duration> {
        self.absent_since.map(|since| since.elapsed())
    }

    /// Takes all messages since the last call.
    pub(super) fn drain(&mut self) {
        let Some((bus, port)) = &mut self.port else { return };
        let Self { overview, second, .. } = self;
        let outcome = port.drain(bus, &mut |message| {
            overview.handle(&message);
            if let Message::Error(error) = message {
                second.add(&error);
            }
        });
        if let Err(error) = outcome {
            (self.port, self.error) = (None, Some(error.into()));
        }
    }

    /// The session's row in the table; resets the sums of the current second.
    pub(super) fn row(&mut self, name: &str) -> SessionRow {
        let second = std::mem::take(&mut self.second);
        let overview = &self.overview;
        let status = overview.status.unwrap_or_default();
        SessionRow {
            session: name.to_owned(),
            phase: match self.absent_since {
                Some(_) => "gone",
                None => overview.phase().map_or("-", Phase::name),
            },
            time: overview.time(),
            law: overview.law().map_or("-", |law| law.name),
            error: second.rms_error(),
            // Without blanks, so that programs can split the row into columns.
            signal: second.signal().map(|(symbol, mean)| format!("{symbol}={mean:.3}")),
            round_trip: overview.round_trips.spread(),
            leader: match (overview.leader(), &overview.controller().presence) {
                (None, _) => "-".to_owned(),
                (Some(_), None) => "?".to_owned(),
                (Some(_), Some(presence)) => process_at_host(presence),
            },
            standby: overview.standing_by(),
            counts: [
                status.lost,
                status.too_old,
                status.late,
                status.rejected,
                status.timeouts,
                status.takeovers,
                overview.missed,
            ],
            alarm: match (&self.error, self.absent_since) {
                (Some(error), _) => Some(error.to_string()),
                (None, Some(_)) => Some("nobody takes part any more".to_owned()),
                (None, None) => overview.alarm().map(|alarm| alarm.sentence()),
            },
        }
    }
}

/// A process and its machine: `4242@robot`.
fn process_at_host(presence: &PresenceSample) -> String {
    let host: String = text_of(&presence.host).chars().filter(char::is_ascii_graphic).collect();
    format!("{}@{host}", presence.process)
}
