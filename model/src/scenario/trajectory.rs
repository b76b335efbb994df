//! The desired motion of a scenario.

use nalgebra::Vector2;

use super::{
    error::ScenarioError,
    section::{self, Section},
};
use crate::trajectory::{Circle, PointToPoint, Ripple, Trajectory};

#[derive(Clone, Copy)]
enum Kind {
    PerturbedCircle,
    Circle,
    PointToPoint,
}

impl Trajectory<f64> {
    pub(super) fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let kinds = [
            ("perturbed-circle", Kind::PerturbedCircle),
            ("circle", Kind::Circle),
            ("point-to-point", Kind::PointToPoint),
        ];
        let trajectory = match section.choice("kind", &kinds, None)? {
            Kind::Circle => Self::Circle(circle(&section)?),
            Kind::PerturbedCircle => {
                let circle = circle(&section)?;
                Self::PerturbedCircle(circle, ripple(section.section("ripple")?)?)
            }
            Kind::PointToPoint => Self::PointToPoint(PointToPoint {
                from: point(&section, "from")?
                    .ok_or_else(|| section.refuse("from", "a list of 2 numbers in m"))?,
                to: point(&section, "to")?
                    .ok_or_else(|| section.refuse("to", "a list of 2 numbers in m"))?,
                duration: section
                    .duration("duration", std::time::Duration::from_nanos(1), None)?
                    .as_secs_f64(),
            }),
        };
        section.finish()?;
        Ok(trajectory)
    }
}

fn circle(section: &Section<'_>) -> Result<Circle<f64>, ScenarioError> {
    Ok(Circle {
        center: point(section, "center")?.unwrap_or_else(Vector2::zeros),
        radius: section.required("radius", "a radius in m greater than 0", section::positive)?,
        angular_frequency: section.required(
            "angular_frequency",
            "a number in rad/s",
            section::number,
        )?,
        phase: section.optional("phase", "an angle in rad", section::number)?.unwrap_or(0.0),
    })
}

fn ripple(section: Section<'_>) -> Result<Ripple<f64>, ScenarioError> {
    let ripple = Ripple {
        amplitude: section.required("amplitude", "an amplitude in m", section::number)?,
        multiple: section.required("multiple", "how many ripples a turn has", section::number)?,
    };
    section.finish()?;
    Ok(ripple)
}

fn point(section: &Section<'_>, key: &str) -> Result<Option<Vector2<f64>>, ScenarioError> {
    let list =
        section.optional(key, "a list of 2 numbers in m", |value| section::numbers(value, 2))?;
    Ok(list.map(|list| Vector2::new(list[0], list[1])))
}
