//! The check that a session has one plant.

use std::{
    thread,
    time::{Duration, Instant},
};

use crate::{
    bus::{Attendance, Bus, BusError},
    member::{Member, Role},
};

/// How often to look for another plant.
const PERIOD: Duration = Duration::from_secs(1);
/// How long a bus may show a plant that has just died.
const DYING: Duration = Duration::from_secs(1);
/// How often to look whether it is gone.
const RETRY: Duration = Duration::from_millis(20);

/// The watch for other plants of a session.
pub(super) struct OtherPlants {
    attendance: Box<dyn Attendance>,
    own: u64,
    next: Instant,
    is_told: bool,
}

impl OtherPlants {
    /// Begins the watch of the plant `own`.
    ///
    /// # Errors
    ///
    /// [`BusError::SecondPlant`] if the session has a plant.
    pub(super) fn watch(bus: &impl Bus, session: &str, own: &Member) -> Result<Self, BusError> {
        let attendance = bus.attendance()?;
        let mut watch = Self { attendance, own: own.id, next: Instant::now(), is_told: false };
        let end = Instant::now() + DYING;
        while watch.is_there_another()? {
            if Instant::now() >= end {
                return Err(BusError::SecondPlant { session: session.to_owned() });
            }
            thread::sleep(RETRY);
        }
        Ok(watch)
    }

    fn is_there_another(&mut self) -> Result<bool, BusError> {
        let present = self.attendance.present()?;
        Ok(present.iter().any(|member| member.role == Role::Plant && member.id != self.own))
    }

    /// Looks once a second, and warns once of a plant that the bus did not show before: as where two
    /// networks were joined.
    pub(super) fn look(&mut self) -> Result<(), BusError> {
        if self.is_told || Instant::now() < self.next {
            return Ok(());
        }
        self.next = Instant::now() + PERIOD;
        if self.is_there_another()? {
            self.is_told = true;
            tracing::warn!(
                "this session has another plant, whose samples get mixed with ours: stop one of \
                 them, or give it another name with --session"
            );
        }
        Ok(())
    }
}
