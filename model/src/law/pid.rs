//! PID control of the joints.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter, Per, Signal},
    inverse::{self, DAMPING, KD_OF_JOINTS, PseudoInverse, TORQUE},
};
use crate::{
    MAX_AXES,
    arm::Kinematics,
    gains::JointGains,
    lift,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, key::Range, section::Section},
    task::{self, Task},
};

/// τ = K_p (q_d − q) + K_d (q̇_d − q̇) + K_i ∫ (q_d − q) dt: a PID loop at each joint (Arimoto and
/// Miyazaki, 1983), which ignores how the joints couple.
///
/// The references come by inverse kinematics: q_d solves x(q_d) = x_d, and q̇_d = J⁺(q_d) ẋ_d. q_d is
/// kept from sample to sample and begins at the measured q; each sample brings it to the new x_d with
/// two steps of Newton's method. So it stays on the branch on which the arm began. K_p in
/// N m/rad, K_d in N m s/rad, K_i in N m/(rad s). The integral is the sum of the errors at the
/// samples, each times the interval that ends there.
///
/// On a mass, with K_p = M̄ K_D/T, K_d = M̄/T and K_i = M̄ K_P/T it is time-delay control with memory
/// `sent`, if a rate is a difference over a sample (Chang and Jung, *A systematic method for gain
/// selection of robust PID control for nonlinear plants of second-order controller canonical form*,
/// IEEE Trans. Control Syst. Technol. 17, 2009).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPid<T, const M: usize> {
    /// K_p.
    pub kp: JointGains<T>,
    /// K_d.
    pub kd: JointGains<T>,
    /// K_i.
    pub ki: JointGains<T>,
}

lift! { struct JointPid<T, M> { kp, kd, ki } }

/// Steps of Newton's method a sample. An error of ε rad becomes about ε² in a step, so that two leave
/// about 1e-7 rad where x_d moves by centimetres a sample.
pub const STEPS: usize = 2;

/// law.kp.
const KP: Parameter = Parameter {
    key: "law.kp",
    label: "K_p",
    form: Form::JointList(Range::Positive),
    unit: "N m/rad",
    default: Default::Required,
    help: "Stiffness: torque for each rad of the joint's error.",
};

/// law.ki.
const KI: Parameter = Parameter {
    key: "law.ki",
    label: "K_i",
    form: Form::JointList(Range::NotNegative),
    unit: "N m/(rad s)",
    default: Default::Value("0.0"),
    help: "Torque for each rad s of the integral of the joint's error.",
};

/// Where the joints should be.
const DESIRED: Signal = Signal {
    key: "desired_position",
    symbol: "q_d",
    title: "Desired joint positions",
    unit: "rad",
    per: Per::Joint,
    range: None,
};

impl Declaration for JointPid<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "pid",
        title: "joint PID",
        equation: "τ = K_p (q_d − q) + K_d (q̇_d − q̇) + K_i ∫ (q_d − q) dt",
        parameters: &[KP, KD_OF_JOINTS, KI],
        echo: TORQUE,
        has_memory: false,
        has_state: true,
        signals: &[DAMPING, DESIRED],
    };

    fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        _: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let joints = arm.links.len();
        let ki = JointGains::read(law, &KI, joints);
        Ok(Self {
            kp: JointGains::read(law, &KP, joints)?,
            kd: JointGains::read(law, &KD_OF_JOINTS, joints)?,
            ki: ki?,
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        inverse::check("pid", arm, task)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for JointPid<T, M> {
    /// The state is: one when there is a q_d, else zero; q_d; the integral.
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        state: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let (is_known, zero) = (state[0], T::zero());
        let known = |i: usize| zero.where_below(is_known, state[1 + i], now.position[i]);
        let before = SVector::<T, N>::from_fn(|i, _| known(i));
        let (desired, inverse) = follow(now, before);
        let error = desired - now.position;
        let error_rate = inverse.times(&now.desired.velocity) - now.velocity;
        state[0] = T::one();
        for i in 0..N {
            state[1 + i] = desired[i];
            state[1 + N + i] += error[i] * now.interval;
        }
        let integral = SVector::from_fn(|i, _| state[1 + N + i]);
        let torque = self.kp.times(&error) + self.kd.times(&error_rate) + self.ki.times(&integral);
        signals[0] = inverse.damping;
        signals[1..=N].copy_from_slice(desired.as_slice());
        Command::of_torques(torque, inverse.damping)
    }
}

/// Brings q_d to the desired point; also returns J⁺ there.
#[inline(always)]
fn follow<T: Scalar, A: Kinematics<T, N, M>, const N: usize, const M: usize>(
    now: &Situation<'_, T, A, N, M>,
    mut position: SVector<T, N>,
) -> (SVector<T, N>, PseudoInverse<T, N, M>) {
    let mut step = 0;
    loop {
        let at = A::configuration(&position, &SVector::zeros());
        let inverse = PseudoInverse::new(now.arm.jacobian(&at));
        if step == STEPS {
            return (position, inverse);
        }
        let missing = A::Point::difference(&now.desired.point, &now.arm.tip(&at));
        position += inverse.times(&missing);
        step += 1;
    }
}
