//! Which law, and what is common to all laws: memory, prediction and model.

use std::time::Duration;

use super::{ArmSettings, error::ScenarioError, section::Section};
use crate::{
    MAX_AXES,
    law::{
        Equation, Law,
        describe::{Default, Form, Parameter},
        mass,
    },
    task,
};

/// What the controller does.
#[derive(Clone, Debug, PartialEq)]
pub struct LawSettings {
    /// The law with its own settings.
    pub law: Law<f64, MAX_AXES>,
    /// The previous-step memory, for laws that have one.
    pub memory: MemorySettings,
    /// How far ahead the law aims; `None` for the instant of the sample.
    pub prediction: Option<Horizon>,
    /// By which model, where it aims ahead.
    pub prediction_model: PredictionModel,
    /// Whether gravity is balanced by the controller's model.
    pub gravity: Gravity,
    /// The factor on the masses and inertias of the controller's model.
    pub mass_scale: f64,
}

/// What balances gravity, for laws that do not do that themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gravity {
    /// Nothing.
    None,
    /// The joint torques g(q) of the controller's model, added to the law's and outside its echo.
    Model,
}

/// law.gravity.
pub(super) const GRAVITY: Parameter = Parameter::new(
    "law.gravity",
    Form::Choice(&["none", "model"]),
    "",
    Default::Value("\"none\""),
    "What balances gravity: nothing, or g(q) of the controller's model, outside the echo; mb has it \
     always.",
);

/// The previous-step memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemorySettings {
    /// Which echo it holds.
    pub policy: MemoryPolicy,
    /// Δt, a whole multiple of the sample period.
    pub step: Duration,
}

/// Which echo the previous-step memory holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MemoryPolicy {
    /// The one that the controller computed a step ago: the paper's.
    Sent,
    /// The one in effect at the plant at the sampling instant.
    Applied,
    /// The mean of those in effect over the last memory step.
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
        form: Form::Duration(Duration::ZERO),
        unit: "",
        default: Default::SameAs("timing.sample_period"),
        help: "How old the memory is: a whole multiple of the sample period.",
    },
];

const POLICY: &Parameter = &MEMORY[0];
const STEP: &Parameter = &MEMORY[1];

/// The keys of the prediction, for every law.
pub const PREDICTION: &[Parameter] = &[
    Parameter {
        key: "law.prediction.horizon",
        label: "horizon",
        form: Form::DurationOr(&["none", "measured"]),
        unit: "",
        default: Default::Value("\"none\""),
        help: "How far ahead the law aims: at the instant of the sample, at the instant the torque \
               takes effect, or by a fixed time.",
    },
    Parameter {
        key: "law.prediction.model",
        label: "moves",
        form: Form::Choice(&["kinematic", "rigid-body"]),
        unit: "",
        default: Default::Value("\"kinematic\""),
        help: "What moves meanwhile: the tip with its last acceleration, or the controller's model of \
               the arm under the torques on their way.",
    },
];

const HORIZON: &Parameter = &PREDICTION[0];
const MODEL: &Parameter = &PREDICTION[1];

/// By which model a law aims ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PredictionModel {
    /// The tip goes on with its velocity and its acceleration over the last sample.
    Kinematic,
    /// The arm, as the controller's model knows it, moves under the torques that were sent.
    RigidBody,
}

/// How far ahead a predicting law aims.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Horizon {
    /// The latency, sample instant to application, of the last applied command.
    Measured,
    /// Always the same.
    Fixed(Duration),
}

impl LawSettings {
    pub(super) fn read(
        law: Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
        sample_period: Duration,
    ) -> Result<Self, ScenarioError> {
        let prediction = law.section_or_empty("prediction")?;
        let settings = Self {
            law: Law::read(&law, arm, task)?,
            memory: MemorySettings::read(law.section_or_empty("memory")?, sample_period)?,
            prediction: Horizon::read(&prediction)?,
            prediction_model: prediction
                .word(MODEL, &[PredictionModel::Kinematic, PredictionModel::RigidBody])?,
            gravity: law.word(&GRAVITY, &[Gravity::None, Gravity::Model])?,
            mass_scale: {
                let model = law.section_or_empty("model")?;
                let scale = model.number(&mass::SCALE)?;
                model.finish()?;
                scale
            },
        };
        prediction.finish()?;
        law.finish()?;
        Ok(settings)
    }

    /// Whether the controller's model of the arm says what it will do until the instant that the law
    /// aims at.
    pub fn predicts_by_model(&self) -> bool {
        self.prediction.is_some() && self.prediction_model == PredictionModel::RigidBody
    }

    /// Whether the controller adds the torque that balances gravity to the law's.
    pub fn balances_gravity(&self, arm: &ArmSettings) -> bool {
        let has_gravity = arm.gravity.iter().any(|part| *part != 0.0);
        self.gravity == Gravity::Model && has_gravity && !self.law.balances_gravity()
    }

    /// Whether the law has a memory.
    pub fn has_memory(&self) -> bool {
        self.law.description().has_memory
    }
}

/// The longest memory step, in sample periods: the plant keeps a few numbers for each of them.
const LONGEST_STEP: u128 = 100_000;

impl MemorySettings {
    fn read(section: Section<'_>, sample_period: Duration) -> Result<Self, ScenarioError> {
        let policies = {
            use MemoryPolicy::{Applied, Delivered, Sent};
            [Sent, Applied, Delivered]
        };
        let policy = section.word(POLICY, &policies)?;
        let step = section.optional_duration(STEP)?.unwrap_or(sample_period);
        let settings = Self { policy, step };
        let (step, period) = (settings.step.as_nanos(), sample_period.as_nanos());
        if step < period || !step.is_multiple_of(period) || step / period > LONGEST_STEP {
            let period = super::duration::format(sample_period);
            let expected = format!(
                "a whole multiple of timing.sample_period, at least {period} and at most \
                 {LONGEST_STEP} times that"
            );
            return Err(section.refuse("step", expected));
        }
        section.finish()?;
        Ok(settings)
    }
}

impl Horizon {
    fn read(section: &Section<'_>) -> Result<Option<Self>, ScenarioError> {
        section.get(HORIZON, 1, |value| match value.as_str()? {
            "none" => Some(None),
            "measured" => Some(Some(Self::Measured)),
            text => super::duration::parse(text).map(Self::Fixed).map(Some),
        })
    }
}
