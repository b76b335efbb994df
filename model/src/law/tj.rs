//! Transpose Jacobian control.

use nalgebra::{SMatrix, SVector};

use super::{
    Command, Declaration, Equation, Signals, Situation, State,
    describe::{Default, Description, Form, Parameter, Per, Signal},
};
use crate::{
    MAX_AXES, MAX_JOINTS,
    arm::{Kinematics, planar::Configuration},
    for_axes, for_joints,
    gains::Gains,
    lift,
    matrix::padded,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, section::Section},
    task::{self, TrackingError},
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

/// law.jacobian.
const JACOBIAN: Parameter = Parameter {
    key: "law.jacobian",
    label: "J",
    form: Form::Choice(&["exact", "initial"]),
    unit: "",
    default: Default::Value("\"exact\""),
    help: "The Jacobian of the torque: at the measured posture, or always at the arm's initial one.",
};

impl TransposeJacobian<f64, MAX_AXES> {
    /// Reads law.kp and law.kd.
    pub(super) fn read(law: &Section<'_>, axes: usize) -> Result<Self, ScenarioError> {
        Ok(Self { kp: Gains::read(law, &KP, axes)?, kd: Gains::read(law, &KD, axes)? })
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

/// The law as scenarios name it: τ = Jᵀ Q̂, or τ = J̃ᵀ Q̂ with an approximate Jacobian J̃.
///
/// J̃ is the Jacobian at `arm.position`, which stays the same while the arm moves. Miyazaki, Masutani
/// and Arimoto, *Sensor feedback using approximate Jacobian* (1988), show that gains decide whether a
/// loop with an approximate Jacobian is stable. The tracking error is that of the true tip.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransposeJacobianControl<T, const M: usize> {
    /// K_p and K_d.
    pub gains: TransposeJacobian<T, M>,
    /// The columns of J̃, one for each joint; those past the last are zero. `None` takes the exact J.
    pub approximate: Option<[SVector<T, M>; MAX_JOINTS]>,
}

lift! { struct TransposeJacobianControl<T, M> { gains, approximate } }

impl Declaration for TransposeJacobianControl<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "tj",
        title: "transpose Jacobian",
        equation: "Q̂ = K_p e + K_d ė (7)",
        parameters: &[KP, KD, JACOBIAN],
        echo: FORCE,
        has_memory: false,
        has_state: false,
        signals: &[],
    };

    fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let is_approximate = law.word(&JACOBIAN, &[false, true]);
        Ok(Self {
            gains: TransposeJacobian::read(law, task.axes.len())?,
            approximate: is_approximate?.then(|| initial_jacobian(arm, task)),
        })
    }
}

/// The columns of the Jacobian at the arm's initial posture; zeros past the last joint and axis.
fn initial_jacobian(
    arm: &ArmSettings,
    task: &task::Description,
) -> [SVector<f64, MAX_AXES>; MAX_JOINTS] {
    let mut columns = [SVector::zeros(); _];
    for_joints!(arm.joints(), N => for_axes!(task, M => {
        let q = SVector::from_fn(|i, _| arm.position[i]);
        let at = Configuration::new(&q, &SVector::zeros());
        let jacobian: SMatrix<f64, M, N> = arm.build::<N>().jacobian(&at);
        for (column, of_joint) in columns.iter_mut().zip(jacobian.column_iter()) {
            *column = padded(of_joint.as_slice()).into();
        }
    }));
    columns
}

impl<T: Scalar, const M: usize> Equation<T, M> for TransposeJacobianControl<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let Some(columns) = &self.approximate else {
            return self.gains.command(now, state, signals);
        };
        let jacobian = SMatrix::from_fn(|i, j| columns[j][i]);
        Command::of_task_force(&jacobian, &self.gains.task_force(now.error))
    }
}
