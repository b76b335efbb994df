//! Simplified computed torque of a highly geared arm.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter},
    inverse::{self, DAMPING, PseudoInverse, TORQUE},
    mb::{KD_OF_ACCELERATION, KP_OF_ACCELERATION},
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

/// τ = I J⁺ (ẍ_d + K_d ė + K_p e): computed torque for an arm whose inertia matrix is about constant
/// and diagonal, I = diag(n² J_m), because its gears multiply the inertia J_m of each motor by the
/// square of the ratio n.
///
/// After Bevly, Dubowsky and Mavroidis, *A simplified Cartesian-computed torque controller for highly
/// geared systems*, J. Dyn. Sys. Meas. Control 122 (2000); the equation is reconstructed from that
/// idea. It leaves out C and J̇ q̇; `law.gravity` balances gravity. K_p in 1/s², K_d in 1/s, I in
/// kg m², one for each joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimplifiedComputedTorque<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: Gains<T, M>,
    /// I.
    pub inertia: JointGains<T>,
}

lift! { struct SimplifiedComputedTorque<T, M> { kp, kd, inertia } }

/// law.inertia.
const INERTIA: Parameter = Parameter {
    key: "law.inertia",
    label: "n² J_m",
    form: Form::JointList(Range::Positive),
    unit: "kg m²",
    default: Default::Required,
    help: "Inertia that a joint's motor feels, seen from the joint.",
};

impl Declaration for SimplifiedComputedTorque<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "scct",
        title: "simplified computed torque",
        equation: "τ = diag(n² J_m) J⁺ (ẍ_d + K_d ė + K_p e)",
        parameters: &[KP_OF_ACCELERATION, KD_OF_ACCELERATION, INERTIA],
        echo: TORQUE,
        has_memory: false,
        has_state: false,
        signals: &[DAMPING],
    };

    fn read(
        law: &Section<'_>,
        arm: &ArmSettings,
        task: &task::Description,
    ) -> Result<Self, ScenarioError> {
        let (joints, axes) = (arm.links.len(), task.axes.len());
        let inertia = JointGains::read(law, &INERTIA, joints);
        Ok(Self {
            kp: Gains::read(law, &KP_OF_ACCELERATION, axes)?,
            kd: Gains::read(law, &KD_OF_ACCELERATION, axes)?,
            inertia: inertia?,
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        inverse::check("scct", arm, task)
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for SimplifiedComputedTorque<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        _: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let wanted: SVector<T, M> = self.kp.times(&now.error.position)
            + self.kd.times(&now.error.velocity)
            + now.desired.acceleration;
        let inverse = PseudoInverse::new(now.jacobian());
        signals[0] = inverse.damping;
        let torque = self.inertia.times(&inverse.times(&wanted));
        Command::of_torques(torque, inverse.damping)
    }
}
