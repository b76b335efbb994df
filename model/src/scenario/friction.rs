//! The friction of a scenario's joints.

use super::{
    error::ScenarioError,
    key::{Default::Value, Form, Parameter, Range},
    section::Section,
};
use crate::arm::friction::{DryFriction, Friction, Stribeck};

const COULOMB: Parameter = Parameter::new(
    "arm.friction.coulomb",
    Form::JointList(Range::NotNegative),
    "N m",
    Value("0.0"),
    "What resists a joint that turns, however fast.",
);
const VISCOUS: Parameter = Parameter::new(
    "arm.friction.viscous",
    Form::JointList(Range::NotNegative),
    "N m s/rad",
    Value("0.0"),
    "What resists in proportion to the speed.",
);
const STRIBECK: Parameter = Parameter::new(
    "arm.friction.stribeck",
    Form::JointList(Range::NotNegative),
    "N m",
    Value("0.0"),
    "What a joint that hardly turns resists with besides; it fades as exp(−(q̇/stribeck_speed)²).",
);
const STRIBECK_SPEED: Parameter = Parameter::new(
    "arm.friction.stribeck_speed",
    Form::Number(Range::Positive),
    "rad/s",
    Value("0.1"),
    "How fast a joint turns when a third of that is left.",
);
const SMOOTHING: Parameter = Parameter::new(
    "arm.friction.smoothing",
    Form::Number(Range::Positive),
    "rad/s",
    Value("0.01"),
    "Coulomb's friction grows as tanh(q̇/smoothing), so that a joint comes to rest without a jump.",
);
/// The keys of `arm.friction`.
pub const FRICTION: &[&Parameter] = &[&COULOMB, &VISCOUS, &STRIBECK, &STRIBECK_SPEED, &SMOOTHING];

/// The friction of an arm's joints; lists have a number for each joint.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionSettings {
    /// N m.
    pub coulomb: Vec<f64>,
    /// N m s/rad.
    pub viscous: Vec<f64>,
    /// N m.
    pub stribeck: Vec<f64>,
    /// rad/s.
    pub stribeck_speed: f64,
    /// rad/s.
    pub smoothing: f64,
}

impl FrictionSettings {
    /// `None` if nothing resists.
    pub(super) fn read(section: Section<'_>, joints: usize) -> Result<Option<Self>, ScenarioError> {
        let each = |key| Ok(section.one_or_each(key, joints)?.unwrap_or_default());
        let settings = Self {
            coulomb: each(&COULOMB)?,
            viscous: each(&VISCOUS)?,
            stribeck: each(&STRIBECK)?,
            stribeck_speed: section.number(&STRIBECK_SPEED)?,
            smoothing: section.number(&SMOOTHING)?,
        };
        section.finish()?;
        let all = [&settings.coulomb, &settings.viscous, &settings.stribeck];
        let resists = all.into_iter().flatten().any(|number| *number > 0.0);
        Ok(resists.then_some(settings))
    }

    /// The friction with static dimensions; `N` is the number of joints.
    pub fn build<const N: usize>(&self) -> Friction<f64, N> {
        let each = |list: &[f64]| std::array::from_fn(|i| list[i]);
        let is_some = |list: &[f64]| list.iter().any(|number| *number > 0.0);
        let stribeck = is_some(&self.stribeck)
            .then(|| Stribeck { torque: each(&self.stribeck), speed: self.stribeck_speed });
        let dry = (is_some(&self.coulomb) || stribeck.is_some()).then(|| DryFriction {
            coulomb: each(&self.coulomb),
            smoothing: self.smoothing,
            stribeck,
        });
        Friction { viscous: each(&self.viscous), dry }
    }
}
