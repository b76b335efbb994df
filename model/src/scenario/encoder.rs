//! The encoders of a scenario's joints.

use std::time::Duration;

use super::{
    error::ScenarioError,
    key::{Default::Value, Form, Parameter, Range},
    section::Section,
};

const RESOLUTION: Parameter = Parameter::new(
    "encoder.resolution",
    Form::JointList(Range::NotNegative),
    "rad",
    Value("0.0"),
    "Angles are measured in whole multiples of it; 0 for exact ones.",
);
const VELOCITY: Parameter = Parameter::new(
    "encoder.velocity",
    Form::Choice(&["measured", "differentiated"]),
    "",
    Value("\"measured\""),
    "Where velocities come from: a sensor of their own, or the difference of two angles over the \
     sample period.",
);
const FILTER: Parameter = Parameter::new(
    "encoder.filter",
    Form::Duration(Duration::ZERO),
    "",
    Value("\"0 s\""),
    "Time constant of a low-pass filter of first order on the velocities.",
);
/// The keys of `encoder`.
pub(super) const KEYS: &[&Parameter] = &[&RESOLUTION, &VELOCITY, &FILTER];

/// How joints are measured.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderSettings {
    /// For each joint, rad; 0 for exact angles.
    pub resolution: Vec<f64>,
    /// Whether velocities are differences of angles.
    pub differentiates: bool,
    /// Time constant of the filter of the velocities; zero for none.
    pub filter: Duration,
}

impl EncoderSettings {
    /// `None` if the encoders are perfect.
    pub(super) fn read(section: Section<'_>, joints: usize) -> Result<Option<Self>, ScenarioError> {
        let settings = Self {
            resolution: section.one_or_each(&RESOLUTION, joints)?.unwrap_or_default(),
            differentiates: section.word(&VELOCITY, &[false, true])?,
            filter: section.duration(&FILTER)?,
        };
        section.finish()?;
        let is_coarse = settings.resolution.iter().any(|step| *step > 0.0);
        let is_perfect = !is_coarse && !settings.differentiates && settings.filter.is_zero();
        Ok((!is_perfect).then_some(settings))
    }
}
