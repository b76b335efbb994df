//! Time-delay control.

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Parameter},
    factor::{self, Factor},
    mass::{self, Mass},
    mb::{KD_OF_ACCELERATION, KP_OF_ACCELERATION},
    recalled,
    tj::FORCE,
};
use crate::{
    MAX_AXES,
    arm::Kinematics,
    gains::Gains,
    lift,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, section::Section},
    task,
};

/// Q̂ = h + M̄ (ẍ_d − a + K_d ė + K_p e): time-delay control (Youcef-Toumi and Ito, *A time delay
/// controller for systems with unknown dynamics*, J. Dyn. Sys. Meas. Control 112, 1990).
///
/// Everything that the controller does not know of the arm is in the force and the acceleration of
/// a moment ago, h − M̄ a; so the error obeys ë + K_d ė + K_p e = 0, without a model. With the
/// memory `delivered` the inner loop is stable for 0 < M̄ < 2 m at any latency. With M̄ = Ĥ it is
/// incremental dynamic inversion. K_p in 1/s², K_d in 1/s, M̄ in kg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeDelay<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: Gains<T, M>,
    /// M̄.
    pub mass: Mass<T, M>,
    /// How much of the memory to trust; all of it unless the scenario says otherwise.
    pub factor: Factor<T, M>,
}

lift! { struct TimeDelay<T, M> { kp, kd, mass, factor } }

/// law.mass, which this law needs.
const MASS: Parameter = Parameter { default: Default::Required, ..mass::PARAMETER };

/// law.factor.kind: the law trusts its memory unless the scenario says otherwise.
const FACTOR: Parameter = Parameter { default: Default::Value("\"constant\""), ..factor::KIND };

impl Declaration for TimeDelay<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "tdc",
        title: "time-delay control",
        equation: "Q̂ = h + M̄ (ẍ_d − a + K_d ė + K_p e)",
        parameters: &[
            KP_OF_ACCELERATION,
            KD_OF_ACCELERATION,
            MASS,
            mass::SCALE,
            FACTOR,
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
        let mass = Mass::read(law, &MASS, axes);
        let factor = Factor::read(law, &FACTOR, axes);
        Ok(Self {
            kp: Gains::read(law, &KP_OF_ACCELERATION, axes)?,
            kd: Gains::read(law, &KD_OF_ACCELERATION, axes)?,
            mass: mass?,
            factor: factor?,
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        self.mass.check(arm, task)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for TimeDelay<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        _: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let wanted = now.desired.acceleration - now.acceleration
            + self.kd.times(&now.error.velocity)
            + self.kp.times(&now.error.position);
        let (force, damping) = self.mass.times(&wanted, now);
        let memory = now.memory.map(recalled);
        let answer = self.factor.add_memory(force, now.error, memory.as_ref());
        Command { damping, ..answer.command(&now.jacobian(), signals) }
    }

    fn factor(&self) -> Option<&Factor<T, M>> {
        Some(&self.factor)
    }
}
