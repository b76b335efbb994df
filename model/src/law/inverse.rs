//! Joint velocities from velocities of the tip: the damped pseudo-inverse of the Jacobian.

use nalgebra::{SMatrix, SVector};

use super::Unsuited;
use crate::{
    matrix,
    scalar::Scalar,
    scenario::{arm::ArmSettings, key::Parameter, key::Range},
    task,
};

use super::describe::{Default, Form, Per, Signal};

/// J⁺ = Jᵀ (J Jᵀ)⁻¹, which is J⁻¹ for a square J. A redundant arm moves with the least ‖q̇‖.
///
/// Near a singular posture the inverse of J Jᵀ is damped, see
/// [`matrix::damped_positive_definite_inverse`]. It means nothing for an arm with fewer joints than
/// the task has axes.
#[derive(Clone, Copy, Debug)]
pub struct PseudoInverse<T, const N: usize, const M: usize> {
    jacobian: SMatrix<T, M, N>,
    /// (J Jᵀ)⁻¹, damped.
    inverse: SMatrix<T, M, M>,
    /// How strongly it is damped: 0 where it is not, to 1 where J is singular.
    pub damping: T,
}

impl<T: Scalar, const N: usize, const M: usize> PseudoInverse<T, N, M> {
    /// The pseudo-inverse of a Jacobian.
    #[inline(always)]
    pub fn new(jacobian: SMatrix<T, M, N>) -> Self {
        let transpose = jacobian.transpose();
        let square = matrix::transpose_product(&transpose, &transpose);
        let (inverse, damping) = matrix::damped_positive_definite_inverse(&square);
        Self { jacobian, inverse, damping }
    }

    /// J⁺ ẋ.
    #[inline(always)]
    pub fn times(&self, velocity: &SVector<T, M>) -> SVector<T, N> {
        matrix::transpose_times(&self.jacobian, &matrix::times(&self.inverse, velocity))
    }
}

/// Refuses an arm with fewer joints than the task has axes, for a law that uses J⁺.
pub(super) fn check(
    law: &'static str,
    arm: &ArmSettings,
    task: &task::Description,
) -> Result<(), Unsuited> {
    let (joints, axes) = (arm.links.len(), task.axes.len());
    if joints >= axes { Ok(()) } else { Err(Unsuited::TooFewJoints { law, joints, axes }) }
}

/// How strongly the inverse of the Jacobian is damped, near a singular posture.
pub(super) const DAMPING: Signal = Signal {
    key: "damping",
    symbol: "λ²",
    title: "Damping of J⁻¹ near a singular posture",
    unit: "",
    per: Per::Arm,
    range: Some([0.0, 1.0]),
};

/// The echo of a law that computes joint torques without a task force.
pub(super) const TORQUE: Signal = Signal {
    key: "torque",
    symbol: "τ",
    title: "Joint torques",
    unit: "N m",
    per: Per::Joint,
    range: None,
};

/// law.kd of a law that damps joint velocities.
pub(super) const KD_OF_JOINTS: Parameter = Parameter {
    key: "law.kd",
    label: "K_d",
    form: Form::JointList(Range::NotNegative),
    unit: "N m s/rad",
    default: Default::Required,
    help: "Damping: torque for each rad/s of the joint's velocity error.",
};
