//! M̄, the mass of the tip as a law assumes it: `law.mass`.

use nalgebra::SVector;

use super::{
    Situation, Unsuited,
    describe::{Default, Form, Parameter},
};
use crate::{
    MAX_AXES,
    arm::{self, Kinematics},
    gains::Gains,
    lift, matrix,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, key::Range, section::Section},
    task,
};

/// M̄, kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mass<T, const M: usize> {
    /// One on every axis, as in eq. (11).
    Unit,
    /// A positive definite matrix.
    Constant(Gains<T, M>),
    /// Ĥ = (J H⁻¹ Jᵀ)⁻¹ of the controller's model at the measured configuration.
    TaskInertia,
}

lift! { enum Mass<T, M> { Unit, Constant(mass), TaskInertia } }

/// The word for [`Mass::TaskInertia`].
const TASK_INERTIA: &str = "task-inertia";

/// law.mass.
pub(super) const PARAMETER: Parameter = Parameter {
    key: "law.mass",
    label: "M̄",
    form: Form::MatrixOr(&[TASK_INERTIA]),
    unit: "kg",
    default: Default::Value("1.0"),
    help: "The mass that multiplies accelerations; \"task-inertia\" is that of the model.",
};

/// law.model.mass_scale, for laws that have a model.
pub(crate) const SCALE: Parameter = Parameter {
    key: "law.model.mass_scale",
    label: "model mass",
    form: Form::Number(Range::Positive),
    unit: "",
    default: Default::Value("1.0"),
    help: "What the model's masses and inertias are multiplied with.",
};

impl Mass<f64, MAX_AXES> {
    /// Reads `law.mass`, as it is declared.
    pub(super) fn read(
        law: &Section<'_>,
        key: &Parameter,
        axes: usize,
    ) -> Result<Self, ScenarioError> {
        let mass = law.get(key, axes, |value| match value.as_str() {
            Some(text) => (text == TASK_INERTIA).then_some(Self::TaskInertia),
            None => Gains::of(value, axes).map(Self::Constant),
        })?;
        // The default, one, needs no multiplication, as in eq. (11).
        Ok(if law.has(key) { mass } else { Self::Unit })
    }

    /// Refuses the task inertia of an arm that has none.
    pub(super) fn check(
        &self,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<(), Unsuited> {
        let (joints, axes) = (arm.links.len(), task.axes.len());
        if *self != Self::TaskInertia || joints >= axes {
            return Ok(());
        }
        Err(Unsuited::NoTaskInertia { joints, axes })
    }
}

impl<T: Scalar, const M: usize> Mass<T, M> {
    /// M̄ a, N, for an acceleration a, m/s², and how strongly the inverse is damped that it needs.
    #[inline(always)]
    pub fn times<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        acceleration: &SVector<T, M>,
        now: &Situation<'_, T, A, N, M>,
    ) -> (SVector<T, M>, T) {
        match self {
            Self::Unit => (*acceleration, T::zero()),
            Self::Constant(mass) => (mass.times(acceleration), T::zero()),
            Self::TaskInertia => {
                let mobility = arm::mobility(&now.arm.inertia(now.at), &now.jacobian());
                let (inertia, damping) = matrix::damped_positive_definite_inverse(&mobility);
                (matrix::times(&inertia, acceleration), damping)
            }
        }
    }
}
