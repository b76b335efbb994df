//! Modified transpose Jacobian control.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter},
    factor::{self, Factor, WithMemory},
    mass::{self, Mass},
    recalled,
    tj::{FORCE, KD, KP, TransposeJacobian},
};
use crate::{
    MAX_AXES,
    arm::Kinematics,
    lift,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, section::Section},
    task::{self, TrackingError},
};

/// Q̂ = K_p e + K_d ė + h with h = k · memory, eqs. (13) and (16); with the term M̄ ë of eq. (11)
/// if `law.acceleration` is true.
///
/// The memory is a task force of a moment ago, which is about what the arm's dynamics need now; so
/// K_p e + K_d ė ≈ 0, eq. (17), and the error decays with the time constant K_d/K_p, without a
/// model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModifiedTransposeJacobian<T, const M: usize> {
    /// K_p and K_d.
    pub tj: TransposeJacobian<T, M>,
    /// How much of the memory to trust.
    pub factor: Factor<T, M>,
    /// M̄ of eq. (11), where ë = ẍ_d − a; `None` leaves the term out.
    pub acceleration: Option<Mass<T, M>>,
}

lift! { struct ModifiedTransposeJacobian<T, M> { tj, factor, acceleration } }

/// law.acceleration.
const ACCELERATION: Parameter = Parameter {
    key: "law.acceleration",
    label: "add M̄ ë (11)",
    form: Form::Flag,
    unit: "",
    default: Default::Value("false"),
    help: "Adds the acceleration term of eq. (11), with which the memory stands latency.",
};

impl Declaration for ModifiedTransposeJacobian<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "mtj",
        title: "modified transpose Jacobian",
        equation: "Q̂ = K_p e + K_d ė + h [+ M̄ ë (11)] (16)",
        parameters: &[
            KP,
            KD,
            ACCELERATION,
            mass::PARAMETER,
            mass::SCALE,
            factor::KIND,
            factor::ERROR,
            factor::ERROR_RATE,
            factor::CEILING,
        ],
        echo: FORCE,
        has_memory: true,
        has_state: false,
        signals: factor::SIGNALS,
    };

    fn read(
        law: &Section<'_>,
        _: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let axes = task.axes.len();
        let tj = TransposeJacobian::read(law, axes);
        let adds_acceleration = law.flag(&ACCELERATION);
        let mass = Mass::read(law, &mass::PARAMETER, axes);
        let factor = Factor::read(law, &factor::KIND, axes);
        let mass = mass?;
        Ok(Self { tj: tj?, factor: factor?, acceleration: adds_acceleration?.then_some(mass) })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        self.acceleration.map_or(Ok(()), |mass| mass.check(arm, task))
    }
}

impl<T: Scalar, const M: usize> ModifiedTransposeJacobian<T, M> {
    /// Q̂ from the tracking error and the task force that the memory holds; `None` at the first
    /// step, where k = 0. `acceleration`, if given, is the term M̄ ë of eq. (11), N.
    // A step is so short that passing its vectors through memory would be half of what mtj costs
    // over tj.
    #[inline(always)]
    pub fn task_force(
        &self,
        error: &TrackingError<T, M>,
        remembered: Option<&SVector<T, M>>,
        acceleration: Option<&SVector<T, M>>,
    ) -> WithMemory<T, M> {
        let mut force = self.tj.task_force(error);
        if let Some(acceleration) = acceleration {
            force += acceleration;
        }
        self.factor.add_memory(force, error, remembered)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for ModifiedTransposeJacobian<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        _: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let memory = now.memory.map(recalled);
        let Some(mass) = &self.acceleration else {
            return self
                .task_force(now.error, memory.as_ref(), None)
                .command(&now.jacobian(), signals);
        };
        let (term, damping) = mass.times(&(now.desired.acceleration - now.acceleration), now);
        let answer = self.task_force(now.error, memory.as_ref(), Some(&term));
        Command { damping, ..answer.command(&now.jacobian(), signals) }
    }

    fn factor(&self) -> Option<&Factor<T, M>> {
        Some(&self.factor)
    }
}
