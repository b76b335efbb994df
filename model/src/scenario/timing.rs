//! When samples are taken.

use std::time::Duration;

use super::{
    duration,
    error::ScenarioError,
    key::{
        Default::{Required, Value},
        Form, Parameter, Range,
    },
    section::Section,
};

const CLOCK: Parameter = Parameter::new(
    "timing.clock",
    Form::Choice(&["lockstep", "realtime"]),
    "",
    Value("\"lockstep\""),
    "Virtual time that waits for each answer, or wall time on absolute deadlines.",
);
const SAMPLE_PERIOD: Parameter = Parameter::new(
    "timing.sample_period",
    Form::Duration(Duration::from_micros(10)),
    "",
    Required,
    "T_s: from one measurement of the state to the next.",
);
const INTEGRATION_STEP: Parameter = Parameter::new(
    "timing.integration_step",
    Form::DurationOr(&["auto"]),
    "",
    Value("\"1 ms\""),
    "Longest step of the integrator, more than 0; \"auto\": by tolerance where a study computes in \
     lanes, else 1 ms.",
);
const TOLERANCE: Parameter = Parameter::new(
    "timing.tolerance",
    Form::Number(Range::Positive),
    "rad, rad/s",
    Value("1e-9"),
    "Bound of the estimated error of a step, with integration_step = \"auto\".",
);
/// The keys of `timing`.
pub(super) const KEYS: &[&Parameter] = &[&CLOCK, &SAMPLE_PERIOD, &INTEGRATION_STEP, &TOLERANCE];

/// The plant's time base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Virtual time or wall time.
    pub clock: ClockKind,
    /// T_s.
    pub sample_period: Duration,
    /// The longest step of the integrator.
    pub integration_step: Duration,
    /// Bound of a step's estimated error, rad and rad/s, where the integration step is "auto": for
    /// the lanes of a study. The scalar path takes equal steps.
    pub tolerance: Option<f64>,
}

/// The integration step where it is "auto" and steps are equal.
const STEP: Duration = Duration::from_millis(1);

/// How the plant's time passes.
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
    pub(super) fn read(section: Section<'_>, longest: Duration) -> Result<Self, ScenarioError> {
        // None is "auto".
        let step = section.get(&INTEGRATION_STEP, 1, |value| match value.as_str()? {
            "auto" => Some(None),
            text => duration::parse(text).filter(|step| !step.is_zero()).map(Some),
        })?;
        let tolerance = section.number(&TOLERANCE)?;
        let timing = Self {
            clock: section.word(&CLOCK, &[ClockKind::Lockstep, ClockKind::Realtime])?,
            sample_period: section.duration(&SAMPLE_PERIOD)?,
            integration_step: step.unwrap_or(STEP),
            tolerance: step.is_none().then_some(tolerance),
        };
        if timing.sample_period > longest {
            return Err(section.refuse("sample_period", "no more than the duration of the run"));
        }
        section.finish()?;
        Ok(timing)
    }
}
