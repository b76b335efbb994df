//! Adaptive control.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter, Per, Signal},
    inverse::{self, KD_OF_JOINTS, PseudoInverse, TORQUE},
    mass,
    tj::KP,
};
use crate::{
    MAX_AXES, MAX_STATE,
    arm::{Kinematics, PARAMETERS},
    gains::{Gains, JointGains},
    lift,
    matrix::padded,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, key::Range, section::Section},
    task,
};

/// τ = Y(q, q̇, q̇_r, q̈_r) p̂ + K_D s and dp̂/dt = Γ Yᵀ s, with q̇_r = J⁺ (ẋ_d + Λ e) and s = q̇_r − q̇:
/// Slotine and Li, *On the adaptive control of robot manipulators*, Int. J. Robotics Research 6
/// (1987), here with the reference of a task.
///
/// The law learns the arm's inertial parameters while it moves: see
/// [`Arm::regressor_times`](crate::arm::Arm::regressor_times) for Y and p. It needs the arm's lengths
/// and no masses. q̈_r = J⁺ (ẍ_d + Λ ė − J̇ q̇_r) is the rate of q̇_r for a square J. Sampled at
/// intervals T, p̂ₖ = p̂ₖ₋₁ + Γ T Yₖᵀ sₖ, and then τₖ = Yₖ p̂ₖ + K_D sₖ. Λ is `law.kp`, 1/s; K_D is
/// `law.kd`, N m s/rad, one for each joint; Γ is `law.adaptation`, one number for all parameters in
/// their SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptive<T, const M: usize> {
    /// Λ.
    pub kp: Gains<T, M>,
    /// K_D.
    pub kd: JointGains<T>,
    /// Γ.
    pub adaptation: T,
    /// p̂ at the first sample.
    pub initial: Initial,
}

/// What the law takes for the parameters before it has learned them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Initial {
    /// Zeros.
    Zero,
    /// Those of the controller's model.
    Model,
}

lift! { struct Adaptive<T, M> { kp, kd, adaptation, initial } }
lift! { enum Initial { Zero, Model } }

/// law.kp.
const RATE: Parameter =
    Parameter {
        label: "Λ", unit: "1/s", help: "Velocity for each metre of tracking error.", ..KP
    };

/// law.adaptation.
const ADAPTATION: Parameter = Parameter {
    key: "law.adaptation",
    label: "Γ",
    form: Form::Number(Range::NotNegative),
    unit: "",
    default: Default::Required,
    help: "How fast the estimates of the arm's parameters, in SI units, follow the error.",
};

/// law.initial.
const INITIAL: Parameter = Parameter {
    key: "law.initial",
    label: "begins with",
    form: Form::Choice(&["zero", "model"]),
    unit: "",
    default: Default::Value("\"zero\""),
    help: "The estimates at the first sample: zeros, or the parameters of the controller's model.",
};

/// The first half of p̂.
const COUPLING: Signal = Signal {
    key: "inertia",
    symbol: "D̂",
    title: "Estimated inertias",
    unit: "kg m²",
    per: Per::Joint,
    range: None,
};

/// The second half of p̂.
const MOMENT: Signal = Signal {
    key: "moment",
    symbol: "b̂",
    title: "Estimated first moments",
    unit: "kg m",
    per: Per::Joint,
    range: None,
};

/// Where the state has a one when p̂ has begun: behind p̂.
const HAS_BEGUN: usize = MAX_STATE - 1;

const _: () = assert!(PARAMETERS <= HAS_BEGUN);

impl Declaration for Adaptive<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "adaptive",
        title: "adaptive control",
        equation: "τ = Y p̂ + K_D s, dp̂/dt = Γ Yᵀ s, s = J⁺ (ẋ_d + Λ e) − q̇",
        parameters: &[RATE, KD_OF_JOINTS, ADAPTATION, INITIAL, mass::SCALE],
        echo: TORQUE,
        has_memory: false,
        has_state: true,
        signals: &[COUPLING, MOMENT],
    };

    fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let (joints, axes) = (arm.links.len(), task.axes.len());
        let initial = law.word(&INITIAL, &[Initial::Zero, Initial::Model]);
        let adaptation = law.number(&ADAPTATION);
        Ok(Self {
            kp: Gains::read(law, &RATE, axes)?,
            kd: JointGains::read(law, &KD_OF_JOINTS, joints)?,
            adaptation: adaptation?,
            initial: initial?,
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        inverse::check("adaptive", arm, task)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for Adaptive<T, M> {
    /// The state is p̂, and whether it has begun.
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let inverse = PseudoInverse::new(now.jacobian());
        let velocity: SVector<T, N> =
            inverse.times(&(now.desired.velocity + self.kp.times(&now.error.position)));
        let acceleration: SVector<T, N> = inverse.times(
            &(now.desired.acceleration + self.kp.times(&now.error.velocity)
                - jacobian_rate_times(now, &velocity)),
        );
        let error = velocity - now.velocity;
        let has_begun = state[HAS_BEGUN];
        state[HAS_BEGUN] = T::one();
        if self.initial == Initial::Model {
            for (known, model) in state.iter_mut().zip(now.arm.parameters()) {
                *known = T::zero().where_below(has_begun, *known, model);
            }
        }
        let gain = self.adaptation * now.interval;
        let slope = now.arm.regressor_transpose_times(now.at, &velocity, &acceleration, &error);
        for (known, slope) in state.iter_mut().zip(slope) {
            *known += gain * slope;
        }
        let parameters: [T; PARAMETERS] = padded(&state[..HAS_BEGUN]);
        signals[..PARAMETERS].copy_from_slice(&parameters);
        let model = now.arm.regressor_times(now.at, &velocity, &acceleration, &parameters);
        let torque = model + self.kd.times(&error);
        Command::of_torques(torque, inverse.damping)
    }

    fn balances_gravity(&self) -> bool {
        true
    }
}

/// J̇ q̇_r, m/s². It is bilinear and symmetric in q̇ and q̇_r, so that it follows from J̇ q̇ at two other
/// velocities: B(u, w) = (B(u + w, u + w) − B(u − w, u − w))/4.
#[inline(always)]
fn jacobian_rate_times<T: Scalar, A: Kinematics<T, N, M>, const N: usize, const M: usize>(
    now: &Situation<'_, T, A, N, M>,
    reference: &SVector<T, N>,
) -> SVector<T, M> {
    let bend = |velocity: SVector<T, N>| {
        now.arm.jacobian_rate_velocity(&A::turning(now.at, now.position, &velocity))
    };
    (bend(now.velocity + reference) - bend(now.velocity - reference)) * T::constant(0.25)
}
