//! The actuators of a scenario's joints.

use std::time::Duration;

use super::{
    error::ScenarioError,
    key::{
        Default::{Value, Words},
        Form, Parameter, Range,
    },
    section::Section,
};

const TIME_CONSTANT: Parameter = Parameter::new(
    "actuator.time_constant",
    Form::Duration(Duration::ZERO),
    "",
    Value("\"0 s\""),
    "The torque follows its command with a lag of first order.",
);
const RATE_LIMIT: Parameter = Parameter::new(
    "actuator.torque_rate_limit",
    Form::JointList(Range::Positive),
    "N m/s",
    Words("no limit"),
    "The torque goes to its command no faster, on a straight line and on all joints in the same time; \
     not together with a time constant.",
);
const RESOLUTION: Parameter = Parameter::new(
    "actuator.resolution",
    Form::JointList(Range::NotNegative),
    "N m",
    Value("0.0"),
    "Torques are whole multiples of it; 0 for exact ones.",
);
/// The keys of `actuator`.
pub(super) const KEYS: &[&Parameter] = &[&TIME_CONSTANT, &RATE_LIMIT, &RESOLUTION];

/// How torques follow their commands.
#[derive(Clone, Debug, PartialEq)]
pub struct ActuatorSettings {
    /// How a torque gets to its command; `None` for at once.
    pub course: Option<CourseSettings>,
    /// For each joint, N m; 0 for exact torques.
    pub resolution: Vec<f64>,
}

/// How a torque gets to its command.
#[derive(Clone, Debug, PartialEq)]
pub enum CourseSettings {
    /// With a lag of first order.
    Lag(Duration),
    /// No faster than so, for each joint, N m/s.
    Ramp(Vec<f64>),
}

impl ActuatorSettings {
    /// `None` if the actuators are perfect.
    pub(super) fn read(section: Section<'_>, joints: usize) -> Result<Option<Self>, ScenarioError> {
        let lag = Some(section.duration(&TIME_CONSTANT)?).filter(|lag| !lag.is_zero());
        let ramp = section.one_or_each(&RATE_LIMIT, joints)?;
        if lag.is_some() && ramp.is_some() {
            return Err(section.refuse(
                RATE_LIMIT.name(),
                "either a time constant or a rate limit of the actuators, not both",
            ));
        }
        let resolution = section.one_or_each(&RESOLUTION, joints)?.unwrap_or_default();
        section.finish()?;
        let course = lag.map(CourseSettings::Lag).or(ramp.map(CourseSettings::Ramp));
        let is_perfect = course.is_none() && resolution.iter().all(|step| *step == 0.0);
        Ok((!is_perfect).then_some(Self { course, resolution }))
    }
}
