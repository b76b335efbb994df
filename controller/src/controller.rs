//! One state sample in, one torque sample out.

use std::fmt;

use mtj_model::{
    PLANE,
    arm::{PlanarArm, Pose},
    for_links, matrix,
    scenario::{FactorKind, FactorSettings, LawKind, Scenario},
    task::TaskDynamics,
    trajectory::{Motion, Trajectory},
};
use mtj_protocol::sample::{ErrorSample, StateSample, TorqueSample, padded};
use nalgebra::{SMatrix, SVector};

use crate::{
    law::{
        Factor, ModelBased, ModifiedTransposeJacobian, Regulation, Remembered, TrackingError,
        TransposeJacobian,
    },
    memory::Memory,
    prediction::{Predictor, Tip},
};

/// A law with its memory, ready to answer states.
///
/// The same object answers a direct call in a sweep, a thread, or a bus; it allocates nothing after
/// it was made and knows neither clocks nor transports.
pub struct Controller {
    law: Box<dyn Respond>,
    answered: TorqueSample,
    error: ErrorSample,
}

/// Why a state could not be answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LawError {
    /// mb needs J⁻¹, and J has none at this time (s).
    Singular(f64),
    /// The state has another number of joints than the scenario's arm.
    Joints {
        /// In the scenario.
        expected: usize,
        /// In the state.
        found: u32,
    },
}

impl fmt::Display for LawError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Singular(time) => write!(
                f,
                "law.kind = \"mb\" inverts the Jacobian, which is singular at t = {time} s; keep the \
                 path away from the rim of the workspace, or use tj or mtj, which need no inverse"
            ),
            Self::Joints { expected, found } => {
                write!(f, "the state sample has {found} joints, the scenario's arm {expected}")
            }
        }
    }
}

impl std::error::Error for LawError {}

impl Controller {
    /// The controller that a scenario describes.
    pub fn new(scenario: &Scenario) -> Self {
        let law = law(scenario, None, Predictor::new(scenario.law.prediction));
        Self { law, answered: TorqueSample::default(), error: ErrorSample::default() }
    }

    /// Goes on under a scenario that was changed while it runs, for the same arm: with what it remembers, so
    /// that a change of something else gives the arm no jerk.
    pub fn adopt(&mut self, scenario: &Scenario) {
        let (memory, predictor) = self.law.remembered();
        let (memory, predictor) = (
            memory.map(|memory| memory.adopt(&scenario.law.memory)),
            predictor.adopt(scenario.law.prediction),
        );
        self.law = law(scenario, memory, predictor);
    }

    /// τ = J_Cᵀ Q̂ for a measured state, with Q̂ from the law. The desired motion is evaluated at the
    /// sample's own time stamp (plus the prediction horizon), never at the time of arrival.
    pub fn respond(&mut self, state: &StateSample) -> Result<TorqueSample, LawError> {
        (self.answered, self.error) = self.law.respond(state)?;
        Ok(self.answered)
    }

    /// Takes the place of another controller that answered `state` with `torque`, as if it had done so
    /// itself; a memory step that is longer than a sample period it knows from its next beginning on.
    pub fn take_over(
        &mut self,
        state: &StateSample,
        torque: &TorqueSample,
    ) -> Result<(), LawError> {
        self.respond(state)?;
        self.law.remember(torque);
        self.answered = *torque;
        Ok(())
    }

    /// How the law saw the instant it answered last.
    pub fn error(&self) -> &ErrorSample {
        &self.error
    }

    /// The answer to the last state once more, for a plant that did not get it.
    pub fn answer_again(&self, state: &StateSample) -> TorqueSample {
        TorqueSample { state_sent_ns: state.sent_ns, ..self.answered }
    }
}

trait Respond {
    fn respond(&mut self, state: &StateSample) -> Result<(TorqueSample, ErrorSample), LawError>;
    /// Believes to have answered the last state so.
    fn remember(&mut self, torque: &TorqueSample);
    /// What is known from earlier samples.
    fn remembered(&self) -> (Option<Memory>, Predictor);
}

fn law(scenario: &Scenario, memory: Option<Memory>, predictor: Predictor) -> Box<dyn Respond> {
    for_links!(scenario.arm.links.len(), N => {
        Box::new(ArmController::<N>::new(scenario, memory, predictor))
    })
}

/// A law for an arm of `N` links.
struct ArmController<const N: usize> {
    /// The arm's geometry; for mb its mass properties too, as far as the model knows them.
    arm: PlanarArm<f64, N>,
    trajectory: Trajectory<f64>,
    law: Law,
    predictor: Predictor,
}

enum Law {
    Tj(TransposeJacobian<f64, PLANE>),
    Mtj { law: ModifiedTransposeJacobian<f64, PLANE>, memory: Memory, acceleration: bool },
    Mb(ModelBased<f64, PLANE>),
}

/// |J| |J⁻¹| beyond which a Jacobian counts as singular.
const WORST_CONDITION: f64 = 1e9;

impl<const N: usize> ArmController<N> {
    fn new(scenario: &Scenario, memory: Option<Memory>, predictor: Predictor) -> Self {
        let settings = &scenario.law;
        let (kp, kd) = (settings.kp, settings.kd);
        let tj = TransposeJacobian { kp, kd };
        let law = match settings.kind {
            LawKind::Tj => Law::Tj(tj),
            LawKind::Mtj => Law::Mtj {
                law: ModifiedTransposeJacobian {
                    tj,
                    factor: factor(&settings.factor),
                    ceiling: settings.factor.ceiling,
                },
                memory: memory.unwrap_or_else(|| Memory::new(&settings.memory)),
                acceleration: settings.acceleration,
            },
            LawKind::Mb => Law::Mb(ModelBased { kp, kd }),
        };
        Self {
            arm: scenario.arm.scaled(settings.mass_scale).build(),
            trajectory: scenario.trajectory,
            law,
            predictor,
        }
    }

    fn forget(&mut self) {
        self.predictor.forget();
        if let Law::Mtj { memory, .. } = &mut self.law {
            memory.forget();
        }
    }
}

impl Law {
    fn task_force<const N: usize>(
        &mut self,
        state: &StateSample,
        pose: &Pose<'_, f64, N>,
        error: &TrackingError<f64, PLANE>,
        desired: &Motion<f64, PLANE>,
        tip_acceleration: &SVector<f64, PLANE>,
    ) -> Result<Remembered<f64, PLANE>, LawError> {
        let without_memory =
            |force| Remembered { force, memory: SVector::zeros(), factor: Regulation::Nothing };
        match self {
            Law::Tj(law) => Ok(without_memory(law.task_force(error))),
            Law::Mtj { law, memory, acceleration } => {
                let recalled = memory.recall(state);
                let error_acceleration =
                    acceleration.then(|| desired.acceleration - tip_acceleration);
                let answer = law.task_force(error, recalled.as_ref(), error_acceleration.as_ref());
                memory.store(state, &answer.force);
                Ok(answer)
            }
            Law::Mb(law) => {
                let singular = LawError::Singular(state.header.time_ns as f64 * 1e-9);
                let dynamics = task_dynamics(pose).ok_or(singular)?;
                Ok(without_memory(law.task_force(error, &desired.acceleration, &dynamics)))
            }
        }
    }
}

impl<const N: usize> Respond for ArmController<N> {
    fn respond(&mut self, state: &StateSample) -> Result<(TorqueSample, ErrorSample), LawError> {
        let header = state.header.answer();
        if header.joints as usize != N {
            return Err(LawError::Joints { expected: N, found: header.joints });
        }
        if state.timed_out != 0 {
            // The arm stands, or falls, as the plant's safety says: nothing that was before counts.
            self.forget();
        }
        let q = SVector::from_fn(|i, _| state.position[i]);
        let q_dot = SVector::from_fn(|i, _| state.velocity[i]);
        let pose = self.arm.pose(&q, &q_dot);
        let now = Tip {
            time: header.time_ns as f64 * 1e-9,
            position: pose.tip(),
            velocity: pose.tip_velocity(),
        };
        let acceleration = self.predictor.acceleration(&now);
        let aim = self.predictor.ahead(&now, &acceleration, state);
        self.predictor.store(&now);
        let desired = self.trajectory.at(aim.time);
        let error = TrackingError {
            position: desired.position - aim.position,
            velocity: desired.velocity - aim.velocity,
        };
        let answer = self.law.task_force(state, &pose, &error, &desired, &acceleration)?;
        let jacobian: SMatrix<f64, PLANE, N> = pose.jacobian();
        let torque = matrix::transpose_times(&jacobian, &answer.force);
        let torque = TorqueSample {
            header,
            state_sent_ns: state.sent_ns,
            residence_ns: 0,
            controller: 0,
            torque: padded(torque.as_slice()),
            force: padded(answer.force.as_slice()),
        };
        let error = ErrorSample {
            header,
            law: match self.law {
                Law::Tj(_) => 0,
                Law::Mtj { .. } => 1,
                Law::Mb(_) => 2,
            },
            error: padded(error.position.as_slice()),
            error_rate: padded(error.velocity.as_slice()),
            factor: padded(answer.factor.per_axis().as_slice()),
            memory: padded(answer.memory.as_slice()),
        };
        Ok((torque, error))
    }

    fn remember(&mut self, torque: &TorqueSample) {
        if let Law::Mtj { memory, .. } = &mut self.law {
            memory.replace(&SVector::from_fn(|i, _| torque.force[i]));
        }
    }

    fn remembered(&self) -> (Option<Memory>, Predictor) {
        let memory = match &self.law {
            Law::Mtj { memory, .. } => Some(*memory),
            Law::Tj(_) | Law::Mb(_) => None,
        };
        (memory, self.predictor)
    }
}

/// Ĥ and Ĉ of the model; `None` where J has no inverse, as for every arm that is not of two links.
fn task_dynamics<const N: usize>(pose: &Pose<'_, f64, N>) -> Option<TaskDynamics<f64, PLANE>> {
    if N != PLANE {
        return None;
    }
    let jacobian: SMatrix<f64, PLANE, N> = pose.jacobian();
    let jacobian = SMatrix::<f64, PLANE, PLANE>::from_fn(|i, j| jacobian[(i, j)]);
    let inverse = jacobian.try_inverse()?;
    if jacobian.norm() * inverse.norm() > WORST_CONDITION {
        return None;
    }
    let inertia = pose.inertia();
    let velocity_terms = pose.velocity_terms();
    Some(TaskDynamics::new(
        &SMatrix::from_fn(|i, j| inertia[(i, j)]),
        &SVector::from_fn(|i, _| velocity_terms[i]),
        &inverse,
        &pose.jacobian_rate_velocity(),
    ))
}

fn factor(settings: &FactorSettings) -> Factor<f64, PLANE> {
    let (error, error_rate) = (settings.error[0], settings.error_rate[0]);
    match settings.kind {
        FactorKind::Switch => Factor::Switch { error, error_rate },
        FactorKind::Exponential => Factor::Exponential { error, error_rate },
        FactorKind::Diagonal => {
            Factor::Diagonal { error: settings.error, error_rate: settings.error_rate }
        }
    }
}
