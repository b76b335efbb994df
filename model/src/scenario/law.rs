//! Which law, with which gains, memory and prediction.

use std::time::Duration;

use nalgebra::{SMatrix, SVector};

use super::section::{self, ScenarioError, Section};
use crate::{
    PLANE,
    gains::Gains,
    law::describe::{Default, Form, Parameter},
};

/// The control law and all that any of the three needs, so that changing `kind` is enough to
/// compare laws.
#[derive(Clone, Debug, PartialEq)]
pub struct LawSettings {
    /// Which law.
    pub kind: LawKind,
    /// K_p.
    pub kp: Gains<f64, PLANE>,
    /// K_d.
    pub kd: Gains<f64, PLANE>,
    /// mtj: whether the acceleration term of eq. (11) is added.
    pub acceleration: bool,
    /// mtj: the regulating factor.
    pub factor: FactorSettings,
    /// mtj: the previous-step memory.
    pub memory: MemorySettings,
    /// How far ahead the law aims; `None` for the instant of the sample.
    pub prediction: Option<Horizon>,
    /// mb: what the model's masses and inertias are multiplied with.
    pub mass_scale: f64,
}

/// The three laws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LawKind {
    /// Transpose Jacobian, eq. (7).
    Tj,
    /// Modified transpose Jacobian, eq. (16).
    Mtj,
    /// Model-based, computed torque, eq. (4).
    Mb,
}

impl LawKind {
    /// The name in scenarios and in print.
    pub fn name(self) -> &'static str {
        LAWS.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }
}

const LAWS: [(&str, LawKind); 3] =
    [("tj", LawKind::Tj), ("mtj", LawKind::Mtj), ("mb", LawKind::Mb)];

/// The regulating factor k and its sensitivity thresholds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorSettings {
    /// How k follows from the error.
    pub kind: FactorKind,
    /// ε or e_max, m, per axis.
    pub error: SVector<f64, PLANE>,
    /// ε̇ or ė_max, m/s, per axis.
    pub error_rate: SVector<f64, PLANE>,
    /// What k is multiplied with: its largest value. One in the paper; a held loop is asymptotically
    /// stable only below (2 K_d − K_p T_s)/(2 K_d + K_p T_s).
    pub ceiling: f64,
}

/// How the regulating factor follows from the tracking error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorKind {
    /// Eq. (14): one or zero.
    Switch,
    /// Eq. (15a): from the norms of the error and its rate.
    Exponential,
    /// Eq. (15b): for each axis on its own.
    Diagonal,
}

/// What mtj remembers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemorySettings {
    /// Whose task force.
    pub policy: MemoryPolicy,
    /// Δt, a whole multiple of the sample period.
    pub step: Duration,
}

/// Whose task force the previous-step memory holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryPolicy {
    /// The one the controller computed a step ago: the paper's.
    Sent,
    /// The one in effect at the plant at the sampling instant.
    Applied,
    /// The mean that the plant held over the last memory step.
    Delivered,
}

/// The keys of the memory, for every law that has one.
pub const MEMORY: &[Parameter] = &[
    Parameter {
        key: "law.memory.policy",
        label: "holds what was",
        form: Form::Choice(&["sent", "applied", "delivered"]),
        unit: "",
        default: Default::Value("\"sent\""),
        help: "The echo that the memory holds: computed a step ago, in effect now, or its mean over \
               the last step.",
    },
    Parameter {
        key: "law.memory.step",
        label: "step Δt",
        form: Form::Duration,
        unit: "",
        default: Default::SameAs("timing.sample_period"),
        help: "How old the memory is: a whole multiple of the sample period.",
    },
];

/// The keys of the prediction, for every law.
pub const PREDICTION: &[Parameter] = &[Parameter {
    key: "law.prediction.horizon",
    label: "horizon",
    form: Form::DurationOr(&["none", "measured"]),
    unit: "",
    default: Default::Value("\"none\""),
    help: "How far ahead the law aims: at the instant of the sample, at the instant the torque takes \
           effect, or by a fixed time.",
}];

/// How far ahead a predicting law aims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Horizon {
    /// The latency, sample instant to application, of the last applied command.
    Measured,
    /// Always the same.
    Fixed(Duration),
}

impl LawSettings {
    pub(super) fn read(law: Section<'_>, sample_period: Duration) -> Result<Self, ScenarioError> {
        let settings = Self {
            kind: law.choice("kind", &LAWS, None)?,
            kp: gains(&law, "kp")?,
            kd: gains(&law, "kd")?,
            acceleration: law
                .optional("acceleration", "true or false", toml::Value::as_bool)?
                .unwrap_or(false),
            factor: FactorSettings::read(law.optional_section("factor")?)?,
            memory: MemorySettings::read(law.optional_section("memory")?, sample_period)?,
            prediction: match law.optional_section("prediction")? {
                None => None,
                Some(prediction) => Horizon::read(prediction)?,
            },
            mass_scale: match law.optional_section("model")? {
                None => 1.0,
                Some(model) => {
                    let scale = model.optional(
                        "mass_scale",
                        "a factor greater than 0",
                        section::positive,
                    )?;
                    model.finish()?;
                    scale.unwrap_or(1.0)
                }
            },
        };
        law.finish()?;
        Ok(settings)
    }
}

fn gains(law: &Section<'_>, key: &str) -> Result<Gains<f64, PLANE>, ScenarioError> {
    let expected = format!(
        "a positive definite gain: one number, a list of {PLANE} for a diagonal, or {PLANE} rows of {PLANE}"
    );
    law.required(key, &expected, |value| {
        let gains = if let Some(number) = section::number(value) {
            Gains::Diagonal(SVector::repeat(number))
        } else if let Some(diagonal) = section::numbers(value, PLANE) {
            Gains::Diagonal(SVector::from_row_slice(&diagonal))
        } else {
            let rows = value.as_array().filter(|rows| rows.len() == PLANE)?;
            let entries: Vec<_> =
                rows.iter().map(|row| section::numbers(row, PLANE)).collect::<Option<_>>()?;
            Gains::Full(SMatrix::from_row_slice(&entries.concat()))
        };
        gains.is_positive_definite().then_some(gains)
    })
}

impl FactorSettings {
    /// The paper's e_max = 1 m and ė_max = 10 m/s with eq. (15a), unless the section says otherwise.
    fn read(section: Option<Section<'_>>) -> Result<Self, ScenarioError> {
        let mut settings = Self {
            kind: FactorKind::Exponential,
            error: SVector::repeat(1.0),
            error_rate: SVector::repeat(10.0),
            ceiling: 1.0,
        };
        let Some(section) = section else { return Ok(settings) };
        let kinds = [
            ("switch", FactorKind::Switch),
            ("exponential", FactorKind::Exponential),
            ("diagonal", FactorKind::Diagonal),
        ];
        settings.kind = section.choice("kind", &kinds, Some(settings.kind))?;
        for (key, unit, threshold) in
            [("error", "m", &mut settings.error), ("error_rate", "m/s", &mut settings.error_rate)]
        {
            let expected = format!("a threshold in {unit} greater than 0, or a list of {PLANE}");
            let Some(list) = section.per_axis(key, PLANE, &expected, |x| x > 0.0)? else {
                continue;
            };
            let uneven = list.iter().any(|x| *x != list[0]);
            if uneven && settings.kind != FactorKind::Diagonal {
                return Err(section.refuse(key, "one number, unless kind = \"diagonal\""));
            }
            *threshold = SVector::from_row_slice(&list);
        }
        let ceiling = section.optional("ceiling", "a factor from 0 to 1", |value| {
            section::number(value).filter(|k| (0.0..=1.0).contains(k))
        })?;
        settings.ceiling = ceiling.unwrap_or(settings.ceiling);
        section.finish()?;
        Ok(settings)
    }
}

/// The longest memory step, in sample periods: the plant keeps a few numbers for each of them.
const LONGEST_STEP: u128 = 100_000;

impl MemorySettings {
    fn read(section: Option<Section<'_>>, sample_period: Duration) -> Result<Self, ScenarioError> {
        let mut settings = Self { policy: MemoryPolicy::Sent, step: sample_period };
        let Some(section) = section else { return Ok(settings) };
        let policies = [
            ("sent", MemoryPolicy::Sent),
            ("applied", MemoryPolicy::Applied),
            ("delivered", MemoryPolicy::Delivered),
        ];
        settings.policy = section.choice("policy", &policies, Some(settings.policy))?;
        settings.step = section.duration("step", sample_period, Some(sample_period))?;
        let (step, period) = (settings.step.as_nanos(), sample_period.as_nanos());
        if !step.is_multiple_of(period) || step / period > LONGEST_STEP {
            let period = super::duration::format(sample_period);
            let expected = format!(
                "a whole multiple of timing.sample_period = {period}, at most {LONGEST_STEP} times it"
            );
            return Err(section.refuse("step", expected));
        }
        section.finish()?;
        Ok(settings)
    }
}

impl Horizon {
    fn read(section: Section<'_>) -> Result<Option<Self>, ScenarioError> {
        let expected = format!("\"none\", \"measured\" or {}", super::duration::FORM);
        let horizon = section.required("horizon", &expected, |value| match value.as_str()? {
            "none" => Some(None),
            "measured" => Some(Some(Self::Measured)),
            text => super::duration::parse(text).map(Self::Fixed).map(Some),
        })?;
        section.finish()?;
        Ok(horizon)
    }
}
