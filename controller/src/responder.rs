//! From a posture to a torque: the part of a controller that remembers nothing.

use mtj_model::{
    PLANE,
    arm::{PlanarArm, Pose, Posture},
    gains::Gains,
    matrix,
    scalar::Scalar,
    scenario::LawKind,
    task::TaskDynamics,
    trajectory::{Motion, Trajectory},
};
use nalgebra::{SMatrix, SVector};

use crate::{
    law::{
        Factor, ModelBased, ModifiedTransposeJacobian, Regulation, Remembered, TrackingError,
        TransposeJacobian,
    },
    prediction::Tip,
};

/// What a controller knows of arm and task, and its law. Generic over the number, so that many loops can
/// be answered at once, each in its lane.
#[derive(Clone, Copy, Debug)]
pub struct Responder<T, const N: usize> {
    /// The arm's geometry; for mb its mass properties too, as far as the model knows them.
    pub arm: PlanarArm<T, N>,
    /// What the tip should do.
    pub trajectory: Trajectory<T>,
    /// What to do about it.
    pub law: Law<T>,
}

/// One of the three laws.
#[derive(Clone, Copy, Debug)]
pub enum Law<T> {
    /// Transpose Jacobian.
    Tj(TransposeJacobian<T, PLANE>),
    /// Modified transpose Jacobian; whether the term of eq. (11) is added.
    Mtj {
        /// The law.
        law: ModifiedTransposeJacobian<T, PLANE>,
        /// Whether it has the acceleration term.
        acceleration: bool,
    },
    /// Model-based.
    Mb(ModelBased<T, PLANE>),
}

impl<T> Law<T> {
    /// The law of a kind, from its parts; those it has no use for are let go.
    pub fn new(
        kind: LawKind,
        kp: Gains<T, PLANE>,
        kd: Gains<T, PLANE>,
        factor: Factor<T, PLANE>,
        ceiling: Option<T>,
        acceleration: bool,
    ) -> Self {
        let tj = TransposeJacobian { kp, kd };
        match kind {
            LawKind::Tj => Self::Tj(tj),
            LawKind::Mtj => {
                Self::Mtj { law: ModifiedTransposeJacobian { tj, factor, ceiling }, acceleration }
            }
            LawKind::Mb => Self::Mb(ModelBased { kp: tj.kp, kd: tj.kd }),
        }
    }
}

/// What is remembered, or comes with a sample.
#[derive(Clone, Copy, Debug)]
pub struct Recollection<T> {
    /// The tip at the sample before; [`Tip::unknown`] at the first.
    pub previous: Tip<T>,
    /// How far ahead to aim, s; `None` for not at all.
    pub horizon: Option<T>,
    /// The remembered task force, N; `None` at the first sample.
    pub force: Option<SVector<T, PLANE>>,
    /// The desired motion at an instant that was foreseen, s.
    pub foreseen: Option<(T, Motion<T, PLANE>)>,
}

/// An answer, and how the law saw the instant.
#[derive(Clone, Copy, Debug)]
pub struct Response<T, const N: usize> {
    /// τ, N m.
    pub torque: SVector<T, N>,
    /// Q̂, h and k.
    pub remembered: Remembered<T, PLANE>,
    /// Where the tip should be at the instant that was aimed at.
    pub desired: Motion<T, PLANE>,
    /// e and ė.
    pub error: TrackingError<T, PLANE>,
    /// The tip as measured, to be the previous one next time.
    pub tip: Tip<T>,
    /// |J| |J⁻¹|, for mb; where [`is_singular`] says so, the answer means nothing.
    pub condition: T,
}

/// |J| |J⁻¹| beyond which a Jacobian counts as singular.
const WORST_CONDITION: f64 = 1e9;

/// Whether |J| |J⁻¹| is that of a Jacobian without a usable inverse, or not even a number.
pub fn is_singular(condition: f64) -> bool {
    condition > WORST_CONDITION || condition.is_nan()
}

impl<T: Scalar, const N: usize> Responder<T, N> {
    /// τ = J_Cᵀ Q̂ for the posture measured at `time`, s, with Q̂ from the law.
    #[inline(always)]
    pub fn respond(
        &self,
        time: T,
        posture: Posture<T, N>,
        recollection: &Recollection<T>,
    ) -> Response<T, N> {
        let pose = self.arm.in_posture(posture);
        let tip = Tip { time, position: pose.tip(), velocity: pose.tip_velocity() };
        let acceleration = tip.acceleration_since(&recollection.previous);
        let aim = match recollection.horizon {
            None => tip,
            Some(horizon) => tip.ahead(horizon, &acceleration),
        };
        let desired = match recollection.foreseen {
            Some((time, motion)) if time == aim.time => motion,
            _ => self.trajectory.at(aim.time),
        };
        let error = TrackingError {
            position: desired.position - aim.position,
            velocity: desired.velocity - aim.velocity,
        };
        let force = recollection.force.as_ref();
        let (remembered, condition) =
            self.law.task_force(&pose, &error, &desired, &acceleration, force);
        let jacobian: SMatrix<T, PLANE, N> = pose.jacobian();
        let torque = matrix::transpose_times(&jacobian, &remembered.force);
        Response { torque, remembered, desired, error, tip, condition }
    }
}

impl<T: Scalar> Law<T> {
    #[inline(always)]
    fn task_force<const N: usize>(
        &self,
        pose: &Pose<'_, T, N>,
        error: &TrackingError<T, PLANE>,
        desired: &Motion<T, PLANE>,
        tip_acceleration: &SVector<T, PLANE>,
        recalled: Option<&SVector<T, PLANE>>,
    ) -> (Remembered<T, PLANE>, T) {
        let without_memory =
            |force| Remembered { force, memory: SVector::zeros(), factor: Regulation::Nothing };
        match self {
            Self::Tj(law) => (without_memory(law.task_force(error)), T::zero()),
            Self::Mtj { law, acceleration } => {
                let error_acceleration = if *acceleration {
                    Some(desired.acceleration - tip_acceleration)
                } else {
                    None
                };
                (law.task_force(error, recalled, error_acceleration.as_ref()), T::zero())
            }
            Self::Mb(law) => {
                let (dynamics, condition) = task_dynamics(pose);
                let force = law.task_force(error, &desired.acceleration, &dynamics);
                (without_memory(force), condition)
            }
        }
    }
}

/// Ĥ and Ĉ of the model, and |J| |J⁻¹|; without end where J has no inverse, as for every arm that is not
/// of two links.
#[inline(always)]
fn task_dynamics<T: Scalar, const N: usize>(pose: &Pose<'_, T, N>) -> (TaskDynamics<T, PLANE>, T) {
    let (mut plane, mut inertia) = (SMatrix::<T, PLANE, PLANE>::zeros(), SMatrix::zeros());
    let mut velocity_terms = SVector::<T, PLANE>::zeros();
    if N == PLANE {
        let (jacobian, all, terms) =
            (pose.jacobian::<PLANE>(), pose.inertia(), pose.velocity_terms());
        for i in 0..PLANE {
            velocity_terms[i] = terms[i];
            for j in 0..PLANE {
                plane[(i, j)] = jacobian[(i, j)];
                inertia[(i, j)] = all[(i, j)];
            }
        }
    }
    let inverse = matrix::inverse(&plane);
    let condition = matrix::size(&plane) * matrix::size(&inverse);
    let rate_velocity = pose.jacobian_rate_velocity();
    (TaskDynamics::new(&inertia, &velocity_terms, &inverse, &rate_velocity), condition)
}
