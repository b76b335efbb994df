//! One session of a fleet.

use std::{
    collections::HashMap,
    time::{Duration, Instant},
};

use mtj_model::scenario::LawKind;
use mtj_protocol::{
    bus::Shared,
    member::{Member, Role},
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
    /// Where each controller runs that has said so.
    places: HashMap<u64, String>,
    members: Vec<Member>,
    absent: Option<Instant>,
}

impl<B> Default for Cell<B> {
    fn default() -> Self {
        Self {
            ears: None,
            trouble: None,
            overview: Overview::default(),
            second: Second::default(),
            places: HashMap::new(),
            members: Vec::new(),
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

    /// Takes note of who takes part.
    pub fn attended_by(&mut self, members: Vec<Member>) {
        self.absent = members.is_empty().then(|| self.absent.unwrap_or_else(Instant::now));
        self.members = members;
    }

    /// For how long nobody has taken part.
    pub fn absence(&self) -> Option<Duration> {
        self.absent.map(|since| since.elapsed())
    }

    /// Takes in what was said since the last call.
    pub fn listen(&mut self) {
        let Some((bus, port)) = &mut self.ears else { return };
        let Self { overview, second, places, .. } = self;
        let heard = port.drain(bus, &mut |message| {
            overview.hear(&message);
            match message {
                Message::Error(error) => second.add(&error),
                Message::Presence(presence) => {
                    places.insert(presence.id, place(&presence));
                }
                _ => {}
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
        let law = overview.law();
        let status = overview.status.unwrap_or_default();
        let leader = overview.state.map_or(0, |state| state.leader);
        let controllers = self.members.iter().filter(|member| member.role == Role::Controller);
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
            law: law.map_or("-", LawKind::name),
            error: second.rms_error(),
            factor: second.mean_factor().filter(|_| law == Some(LawKind::Mtj)),
            round_trip: overview.round_trips.spread(),
            in_charge: match leader {
                0 => "-".to_owned(),
                leader => self.places.get(&leader).cloned().unwrap_or_else(|| "?".to_owned()),
            },
            standby: controllers.filter(|member| member.id != leader).count(),
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
    format!("{}@{}", presence.process, text_of(&presence.host))
}
