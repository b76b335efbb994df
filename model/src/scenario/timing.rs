//! When samples are taken.

use std::time::Duration;

use super::{
    error::ScenarioError,
    section::{self, Section},
};

/// The plant's time base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// What waiting means.
    pub clock: ClockKind,
    /// T_s.
    pub sample_period: Duration,
    /// The longest step of the integrator: what was asked for, or 1 ms.
    pub integration_step: Duration,
    /// Where the integration step is "auto": how large the estimated error of a step may be, in rad and
    /// rad/s. The lanes of a study choose their steps so; what takes equal steps takes the above.
    pub tolerance: Option<f64>,
}

/// The integration step unless something else is asked for.
const STEP: Duration = Duration::from_millis(1);
/// The tolerance unless something else is asked for.
const TOLERANCE: f64 = 1e-9;

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
        let is_automatic = section
            .optional("integration_step", "a duration or \"auto\"", |value| {
                Some(value.as_str() == Some("auto"))
            })?
            .unwrap_or(false);
        let tolerance = section.optional(
            "tolerance",
            "an error in rad and rad/s greater than 0",
            section::positive,
        )?;
        let timing = Self {
            tolerance: is_automatic.then(|| tolerance.unwrap_or(TOLERANCE)),
            clock: section.choice("clock", &clocks, Some(ClockKind::Lockstep))?,
            sample_period: section.duration("sample_period", Duration::from_micros(10), None)?,
            integration_step: if is_automatic {
                STEP
            } else {
                section.duration("integration_step", nanosecond, Some(STEP))?
            },
        };
        if timing.sample_period > duration {
            return Err(section.refuse("sample_period", "no more than the duration of the run"));
        }
        section.finish()?;
        Ok(timing)
    }
}
