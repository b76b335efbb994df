//! Model-based control, or computed torque.

use nalgebra::{SMatrix, SVector};

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Description, Parameter},
    inverse::DAMPING,
    mass,
    tj::{FORCE, KD, KP},
};
use crate::{
    MAX_AXES,
    arm::{Kinematics, TaskDynamics},
    gains::Gains,
    lift, matrix,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, section::Section},
    task::{self, TrackingError},
};

/// Q̂ = Ĥ (K_p e + K_d ė + ẍ_d) + Ĉ, eq. (4), which makes the error obey eq. (5):
/// ë + K_d ė + K_p e = 0, if the model is exact. K_p in 1/s², K_d in 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelBased<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: Gains<T, M>,
}

lift! { struct ModelBased<T, M> { kp, kd } }

/// law.kp of a law whose gains act on accelerations.
pub(super) const KP_OF_ACCELERATION: Parameter = Parameter {
    unit: "1/s²",
    help: "Stiffness: acceleration for each metre of tracking error.",
    ..KP
};

/// law.kd of a law whose gains act on accelerations.
pub(super) const KD_OF_ACCELERATION: Parameter = Parameter {
    unit: "1/s",
    help: "Damping: acceleration for each m/s of the tracking error's rate.",
    ..KD
};

impl Declaration for ModelBased<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "mb",
        title: "computed torque",
        equation: "Q̂ = Ĥ (ẍ_d + K_d ė + K_p e) + Ĉ (4)",
        parameters: &[KP_OF_ACCELERATION, KD_OF_ACCELERATION, mass::SCALE],
        echo: FORCE,
        has_memory: false,
        has_state: false,
        signals: &[DAMPING],
    };

    fn read(
        law: &Section<'_>,
        _: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let axes = task.axes.len();
        Ok(Self {
            kp: Gains::read(law, &KP_OF_ACCELERATION, axes)?,
            kd: Gains::read(law, &KD_OF_ACCELERATION, axes)?,
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        check_square("mb", arm, task)
    }
}

/// Refuses an arm whose Jacobian is not square, for a law that computes Ĉ.
pub(super) fn check_square(
    law: &'static str,
    arm: &ArmSettings,
    task: &task::Description,
) -> Result<(), Unsuited> {
    let (joints, axes) = (arm.links.len(), task.axes.len());
    if joints == axes { Ok(()) } else { Err(Unsuited::NotSquare { law, joints, axes }) }
}

impl<T: Scalar, const M: usize> ModelBased<T, M> {
    /// Q̂, N, from the tracking error, the desired acceleration and the model's Ĥ and Ĉ.
    #[inline(always)]
    pub fn task_force(
        &self,
        error: &TrackingError<T, M>,
        desired_acceleration: &SVector<T, M>,
        dynamics: &TaskDynamics<T, M>,
    ) -> SVector<T, M> {
        let acceleration =
            self.kp.times(&error.position) + self.kd.times(&error.velocity) + desired_acceleration;
        matrix::times(&dynamics.inertia, &acceleration) + dynamics.velocity_terms
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for ModelBased<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        _: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let (dynamics, damping) = task_dynamics(now);
        signals[0] = damping;
        let force = self.task_force(now.error, &now.desired.acceleration, &dynamics);
        Command { damping, ..Command::of_task_force(&now.jacobian(), &force) }
    }

    fn balances_gravity(&self) -> bool {
        true
    }
}

/// Ĥ and Ĉ of the model, and how strongly J⁻¹ is damped for them. Means nothing for an arm whose
/// Jacobian is not square.
#[inline(always)]
pub(super) fn task_dynamics<T: Scalar, A: Kinematics<T, N, M>, const N: usize, const M: usize>(
    now: &Situation<'_, T, A, N, M>,
) -> (TaskDynamics<T, M>, T) {
    let (mut jacobian, mut inertia) = (SMatrix::<T, M, M>::zeros(), SMatrix::<T, M, M>::zeros());
    let mut velocity_terms = SVector::<T, M>::zeros();
    if N == M {
        let given = now.jacobian();
        let (all, terms) = (now.arm.inertia(now.at), now.arm.velocity_terms(now.at));
        for i in 0..M {
            velocity_terms[i] = terms[i];
            for j in 0..M {
                jacobian[(i, j)] = given[(i, j)];
                inertia[(i, j)] = all[(i, j)];
            }
        }
    }
    let (inverse, damping) = matrix::damped_inverse(&jacobian);
    let rate_velocity = now.arm.jacobian_rate_velocity(now.at);
    (TaskDynamics::new(&inertia, &velocity_terms, &inverse, &rate_velocity), damping)
}
