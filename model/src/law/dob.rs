//! Computed acceleration with a disturbance observer.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter, Per, Signal},
    inverse::DAMPING,
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

use std::time::Duration;

/// Q̂ = M̄ (ẍ_d + K_d ė + K_p e) + d̂, where the disturbance observer d̂ = Q(s) (F − M̄ a) filters what
/// the nominal mass M̄ does not explain of the force F in effect (Ohnishi, *A new servo method in
/// mechatronics*, Trans. Japanese Soc. Elect. Eng. 107-D, 1987).
///
/// F is the memory, so that `law.memory.policy` says which force counts as in effect, and a is the
/// tip's mean acceleration over the last sample. Q has the time constant T_f = `law.filter` and unit
/// gain at rest. Sampled at intervals T it is d̂ₖ = d̂ₖ₋₁ + g (Fₖ − M̄ aₖ − d̂ₖ₋₁) with g = min(T/T_f, 1);
/// d̂ = 0 at the first sample. With a filter of one sample, T_f ≤ T, it is time-delay control of the
/// same mass. K_p in 1/s², K_d in 1/s, M̄ in kg, d̂ in N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisturbanceObserver<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: Gains<T, M>,
    /// M̄.
    pub mass: Mass<T, M>,
    /// T_f, s; greater than zero.
    pub filter: T,
}

lift! { struct DisturbanceObserver<T, M> { kp, kd, mass, filter } }

/// law.mass, which this law needs.
const MASS: Parameter = Parameter { default: Default::Required, ..mass::PARAMETER };

/// law.filter.
const FILTER: Parameter = Parameter {
    key: "law.filter",
    label: "filter",
    form: Form::Duration(Duration::from_nanos(1)),
    unit: "",
    default: Default::Required,
    help: "Time constant of the disturbance observer's filter.",
};

/// What the observer found.
const DISTURBANCE: Signal = Signal {
    key: "disturbance",
    symbol: "d̂",
    title: "Observed disturbance",
    unit: "N",
    per: Per::Axis,
    range: None,
};

impl Declaration for DisturbanceObserver<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "dob",
        title: "disturbance observer",
        equation: "Q̂ = M̄ (ẍ_d + K_d ė + K_p e) + d̂, d̂ = Q(s) (F − M̄ a)",
        parameters: &[KP_OF_ACCELERATION, KD_OF_ACCELERATION, MASS, FILTER, mass::SCALE],
        echo: FORCE,
        has_memory: true,
        has_state: true,
        signals: &[DAMPING, DISTURBANCE],
    };

    fn read(
        law: &Section<'_>,
        _: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let axes = task.axes.len();
        let filter = law.duration(&FILTER);
        Ok(Self {
            kp: Gains::read(law, &KP_OF_ACCELERATION, axes)?,
            kd: Gains::read(law, &KD_OF_ACCELERATION, axes)?,
            mass: Mass::read(law, &MASS, axes)?,
            filter: filter?.as_secs_f64(),
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        self.mass.check(arm, task)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for DisturbanceObserver<T, M> {
    /// The state is d̂.
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let wanted = now.desired.acceleration
            + self.kd.times(&now.error.velocity)
            + self.kp.times(&now.error.position);
        let (force, damping) = self.mass.times(&wanted, now);
        let (explained, _) = self.mass.times(now.acceleration, now);
        let in_effect = now.memory.map_or_else(SVector::zeros, recalled::<T, M>);
        let (one, ratio) = (T::one(), now.interval / self.filter);
        let gain = ratio.where_below(one, ratio, one);
        for i in 0..M {
            state[i] = (one - gain) * state[i] + gain * (in_effect[i] - explained[i]);
        }
        let disturbance = SVector::<T, M>::from_fn(|i, _| state[i]);
        signals[0] = damping;
        signals[1..=M].copy_from_slice(disturbance.as_slice());
        Command { damping, ..Command::of_task_force(&now.jacobian(), &(force + disturbance)) }
    }
}
