//! When samples are taken.

use std::time::Duration;

use super::section::{ScenarioError, Section};

/// The plant's time base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// What waiting means.
    pub clock: ClockKind,
    /// T_s.
    pub sample_period: Duration,
    /// The longest step of the integrator.
    pub integration_step: Duration,
}

/// What waiting means to the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockKind {
    /// Virtual time: the plant waits for each answer, however long it takes.
    Lockstep,
    /// Wall time on absolute deadlines: answers arrive when they arrive.
    Realtime,
}

impl ClockKind {
    /// The name in scenarios and in print.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lockstep => "lockstep",
            Self::Realtime => "realtime",
        }
    }
}

impl Timing {
    pub(super) fn read(section: Section<'_>, duration: Duration) -> Result<Self, ScenarioError> {
        let nanosecond = Duration::from_nanos(1);
        let clocks = [("lockstep", ClockKind::Lockstep), ("realtime", ClockKind::Realtime)];
        let timing = Self {
            clock: section.choice("clock", &clocks, Some(ClockKind::Lockstep))?,
            sample_period: section.duration("sample_period", Duration::from_micros(10), None)?,
            integration_step: section.duration(
                "integration_step",
                nanosecond,
                Some(Duration::from_millis(1)),
            )?,
        };
        if timing.sample_period > duration {
            return Err(section.refuse("sample_period", "no more than the duration of the run"));
        }
        section.finish()?;
        Ok(timing)
    }
}
