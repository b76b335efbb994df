//! Resolved motion rate control.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter, Per, Signal},
    inverse::{self, DAMPING, KD_OF_JOINTS, PseudoInverse, TORQUE},
    tj::KP,
};
use crate::{
    MAX_AXES,
    arm::Kinematics,
    gains::{Gains, JointGains},
    lift,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, key::Range, section::Section},
    task,
};

/// q̇_c = J⁺ (ẋ_d + K_p e) and τ = K_d (q̇_c − q̇) + K_i ∫ (q̇_c − q̇) dt: the tip's velocity is
/// resolved into joint velocities, and a loop at each joint follows them.
///
/// Whitney, *Resolved motion rate control of manipulators and human prostheses*, IEEE Trans.
/// Man-Machine Systems 10 (1969); Umetani and Yoshida (1989) for space robots; Kelly and Moreno
/// (2005) with a loop of proportional and integral action for the velocities. Both loops are in the
/// controller. K_p in 1/s, K_d in N m s/rad, K_i in N m/rad. The integral is the sum of the velocity
/// errors at the samples, each times the interval that ends there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionRate<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: JointGains<T>,
    /// K_i.
    pub ki: JointGains<T>,
}

lift! { struct MotionRate<T, M> { kp, kd, ki } }

/// law.kp.
const KP_OF_VELOCITY: Parameter =
    Parameter { unit: "1/s", help: "Velocity for each metre of tracking error.", ..KP };

/// law.ki.
const KI: Parameter = Parameter {
    key: "law.ki",
    label: "K_i",
    form: Form::JointList(Range::NotNegative),
    unit: "N m/rad",
    default: Default::Value("0.0"),
    help: "Torque for each rad of the integral of the joint's velocity error.",
};

/// What the joints are asked for.
const COMMANDED: Signal = Signal {
    key: "commanded_velocity",
    symbol: "q̇_c",
    title: "Commanded joint velocities",
    unit: "rad/s",
    per: Per::Joint,
    range: None,
};

impl Declaration for MotionRate<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "rate",
        title: "resolved motion rate",
        equation: "τ = K_d (q̇_c − q̇) + K_i ∫ (q̇_c − q̇) dt, q̇_c = J⁺ (ẋ_d + K_p e)",
        parameters: &[KP_OF_VELOCITY, KD_OF_JOINTS, KI],
        echo: TORQUE,
        has_memory: false,
        has_state: true,
        signals: &[DAMPING, COMMANDED],
    };

    fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let (joints, axes) = (arm.links.len(), task.axes.len());
        let ki = JointGains::read(law, &KI, joints);
        Ok(Self {
            kp: Gains::read(law, &KP_OF_VELOCITY, axes)?,
            kd: JointGains::read(law, &KD_OF_JOINTS, joints)?,
            ki: ki?,
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        inverse::check("rate", arm, task)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for MotionRate<T, M> {
    /// The state is the integral, one number for each joint.
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let inverse = PseudoInverse::new(now.jacobian());
        let tip_velocity = now.desired.velocity + self.kp.times(&now.error.position);
        let commanded: SVector<T, N> = inverse.times(&tip_velocity);
        let error = commanded - now.velocity;
        for i in 0..N {
            state[i] += error[i] * now.interval;
        }
        let integral = SVector::from_fn(|i, _| state[i]);
        let torque = self.kd.times(&error) + self.ki.times(&integral);
        signals[0] = inverse.damping;
        signals[1..=N].copy_from_slice(commanded.as_slice());
        Command::of_torques(torque, inverse.damping)
    }
}
