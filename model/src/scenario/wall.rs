//! The wall of a scenario.

use nalgebra::Vector2;

use super::{
    ArmSettings,
    error::ScenarioError,
    key::{
        Default::{Required, Value},
        Form, Parameter, Range,
    },
    section::Section,
};
use crate::arm::wall::Wall;

const POINT: Parameter =
    Parameter::new("wall.point", Form::Point, "m", Required, "A point on the surface of the wall.");
const NORMAL: Parameter = Parameter::new(
    "wall.normal",
    Form::Point,
    "",
    Required,
    "Which way the surface faces, of any length but zero.",
);
const STIFFNESS: Parameter = Parameter::new(
    "wall.stiffness",
    Form::Number(Range::Positive),
    "N/m",
    Value("10000.0"),
    "Force for each metre that the tip is in the wall.",
);
const DISSIPATION: Parameter = Parameter::new(
    "wall.dissipation",
    Form::Number(Range::NotNegative),
    "s/m",
    Value("0.0"),
    "What is lost on the way in: the force is multiplied by 1 + dissipation · speed into the wall.",
);
/// The keys of `wall`.
pub(super) const KEYS: &[&Parameter] = &[&POINT, &NORMAL, &STIFFNESS, &DISSIPATION];

/// The wall, if there is one; it must not hold the tip at the start.
pub(super) fn read(root: &Section<'_>, arm: &ArmSettings) -> Result<Option<Wall>, ScenarioError> {
    let Some(section) = root.optional_section("wall")? else { return Ok(None) };
    let normal = Vector2::from(section.point(&NORMAL)?);
    if normal.norm() == 0.0 {
        return Err(section.refuse(NORMAL.name(), "a direction, like [0, 1]"));
    }
    let wall = Wall {
        point: section.point(&POINT)?.into(),
        normal: normal / normal.norm(),
        stiffness: section.number(&STIFFNESS)?,
        dissipation: section.number(&DISSIPATION)?,
    };
    let start = arm.ends(&arm.position).last().copied().unwrap_or_default();
    let depth = wall.depth(&start);
    if depth > 0.0 {
        let expected = format!(
            "a wall in front of the tip, which starts at [{:.3}, {:.3}] m, {depth:.3} m inside",
            start.x, start.y
        );
        return Err(section.refuse(POINT.name(), expected));
    }
    section.finish()?;
    Ok(Some(wall))
}
