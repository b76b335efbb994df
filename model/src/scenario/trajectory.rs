//! The desired motion of a scenario.

use std::time::Duration;

use super::{
    error::ScenarioError,
    key::{
        Default::{Required, Value},
        Form, Parameter, Range,
    },
    section::Section,
};
use crate::trajectory::{Circle, PointToPoint, Ripple, Trajectory};

const KIND: Parameter = Parameter::new(
    "trajectory.kind",
    Form::Choice(&["perturbed-circle", "circle", "point-to-point"]),
    "",
    Required,
    "What the tip should do; a perturbed circle is the paper's eq. (18).",
);
/// The keys of every trajectory.
pub(super) const KEYS: &[&Parameter] = &[&KIND];

const CENTER: Parameter = Parameter::new(
    "trajectory.center",
    Form::Point,
    "m",
    Value("[0.0, 0.0]"),
    "Centre of the circle; the base of the arm is the origin.",
);
const RADIUS: Parameter = Parameter::new(
    "trajectory.radius",
    Form::Number(Range::Positive),
    "m",
    Required,
    "Radius of the circle.",
);
const ANGULAR_FREQUENCY: Parameter = Parameter::new(
    "trajectory.angular_frequency",
    Form::Number(Range::Any),
    "rad/s",
    Required,
    "ω: how fast the circle is gone round, counter-clockwise.",
);
const PHASE: Parameter = Parameter::new(
    "trajectory.phase",
    Form::Number(Range::Any),
    "rad",
    Value("0.0"),
    "Where on the circle the motion begins.",
);
/// The keys of a circle, perturbed or not.
pub(super) const CIRCLE_KEYS: &[&Parameter] = &[&CENTER, &RADIUS, &ANGULAR_FREQUENCY, &PHASE];

const AMPLITUDE: Parameter = Parameter::new(
    "trajectory.ripple.amplitude",
    Form::Number(Range::Any),
    "m",
    Required,
    "Amplitude of the sine that is added to both axes.",
);
const MULTIPLE: Parameter = Parameter::new(
    "trajectory.ripple.multiple",
    Form::Number(Range::Any),
    "",
    Required,
    "Ripples a turn: the frequency of that sine as a multiple of ω.",
);
/// The keys that a perturbed circle has besides.
pub(super) const RIPPLE_KEYS: &[&Parameter] = &[&AMPLITUDE, &MULTIPLE];

const FROM: Parameter =
    Parameter::new("trajectory.from", Form::Point, "m", Required, "Where the motion begins.");
const TO: Parameter =
    Parameter::new("trajectory.to", Form::Point, "m", Required, "Where it ends and rests.");
const DURATION: Parameter = Parameter::new(
    "trajectory.duration",
    Form::Duration(Duration::from_nanos(1)),
    "",
    Required,
    "How long the motion takes, at rest at both ends (a quintic in time).",
);
/// The keys of a motion from point to point.
pub(super) const POINT_TO_POINT_KEYS: &[&Parameter] = &[&FROM, &TO, &DURATION];

#[derive(Clone, Copy)]
enum Kind {
    PerturbedCircle,
    Circle,
    PointToPoint,
}

impl Trajectory<f64> {
    pub(super) fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let kinds = [Kind::PerturbedCircle, Kind::Circle, Kind::PointToPoint];
        let trajectory = match section.word(&KIND, &kinds)? {
            Kind::Circle => Self::Circle(circle(&section)?),
            Kind::PerturbedCircle => {
                let circle = circle(&section)?;
                Self::PerturbedCircle(circle, ripple(section.section("ripple")?)?)
            }
            Kind::PointToPoint => Self::PointToPoint(PointToPoint {
                from: section.point(&FROM)?.into(),
                to: section.point(&TO)?.into(),
                duration: section.duration(&DURATION)?.as_secs_f64(),
            }),
        };
        section.finish()?;
        Ok(trajectory)
    }
}

fn circle(section: &Section<'_>) -> Result<Circle<f64>, ScenarioError> {
    Ok(Circle {
        center: section.point(&CENTER)?.into(),
        radius: section.number(&RADIUS)?,
        angular_frequency: section.number(&ANGULAR_FREQUENCY)?,
        phase: section.number(&PHASE)?,
    })
}

fn ripple(section: Section<'_>) -> Result<Ripple<f64>, ScenarioError> {
    let amplitude = section.number(&AMPLITUDE)?;
    let ripple = Ripple { amplitude, multiple: section.number(&MULTIPLE)? };
    section.finish()?;
    Ok(ripple)
}
