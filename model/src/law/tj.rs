//! Transpose Jacobian control.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, Size, State,
    describe::{Default, Description, Form, Parameter, Per, Signal},
};
use crate::{
    MAX_AXES,
    arm::Kinematics,
    gains::Gains,
    lift,
    scalar::Scalar,
    scenario::{error::ScenarioError, section::Section},
    task::TrackingError,
};

/// Q̂ = K_p e + K_d ė, eq. (7): springs and dampers between the tip and the desired motion.
///
/// Needs no model and no inverse; works for any Jacobian. K_p in N/m, K_d in N s/m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransposeJacobian<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: Gains<T, M>,
}

lift! { struct TransposeJacobian<T, M> { kp, kd } }

/// Q̂, the task force from which the torques follow by τ = Jᵀ Q̂.
pub(super) const FORCE: Signal = Signal {
    key: "force",
    symbol: "Q̂",
    title: "Task force",
    unit: "N",
    per: Per::Axis,
    range: None,
};

/// law.kp.
pub(super) const KP: Parameter = Parameter {
    key: "law.kp",
    label: "K_p",
    form: Form::Matrix,
    unit: "N/m",
    default: Default::Required,
    help: "Stiffness: task force for each metre of tracking error.",
};

/// law.kd.
pub(super) const KD: Parameter = Parameter {
    key: "law.kd",
    label: "K_d",
    form: Form::Matrix,
    unit: "N s/m",
    default: Default::Required,
    help: "Damping: task force for each m/s of the tracking error's rate.",
};

impl Declaration for TransposeJacobian<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "tj",
        title: "transpose Jacobian",
        equation: "Q̂ = K_p e + K_d ė (7)",
        parameters: &[KP, KD],
        echo: FORCE,
        has_memory: false,
        has_state: false,
        signals: &[],
    };

    fn read(law: &Section<'_>, size: Size) -> Result<Self, ScenarioError> {
        Ok(Self { kp: Gains::read(law, &KP, size.axes)?, kd: Gains::read(law, &KD, size.axes)? })
    }
}

impl<T: Scalar, const M: usize> TransposeJacobian<T, M> {
    /// Q̂, N.
    #[inline(always)]
    pub fn task_force(&self, error: &TrackingError<T, M>) -> SVector<T, M> {
        self.kp.times(&error.position) + self.kd.times(&error.velocity)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for TransposeJacobian<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        _: &mut State<T>,
        _: &mut Signals<T>,
    ) -> Command<T, N> {
        Command::of_task_force(&now.jacobian(), &self.task_force(now.error))
    }
}
