//! Impedance control.

use nalgebra::SVector;

use super::{
    Command, Declaration, Equation, Signals, Situation, State, Unsuited,
    describe::{Default, Description, Form, Parameter},
    inverse::DAMPING,
    mb,
    tj::{FORCE, KD, KP, TransposeJacobian},
};
use crate::{
    MAX_AXES,
    arm::Kinematics,
    gains::Gains,
    lift, matrix,
    scalar::Scalar,
    scenario::{arm::ArmSettings, error::ScenarioError, section::Section},
    task,
};

/// Q̂ = K_p e + K_d ė, or with a desired inertia M_d: Q̂ = Ĥ (ẍ_d + M_d⁻¹ (K_p e + K_d ė)) + Ĉ. The tip
/// is to answer a force like a mass on a spring and a damper (Hogan, *Impedance control: an approach
/// to manipulation*, J. Dyn. Sys. Meas. Control 107, 1985).
///
/// K_p in N/m, K_d in N s/m, M_d in kg; M_d is `law.inertia`.
///
/// - Without M_d the law is tj, bit for bit: the arm's own inertia stays what it is, and a force at
///   the tip at rest meets the stiffness K_p.
/// - With M_d and an exact model, free motion obeys M_d ë + K_d ė + K_p e = 0: mb with the gains
///   M_d⁻¹ K_p and M_d⁻¹ K_d.
/// - No force is measured. So a force F at the tip acts through the arm's own inertia: M_d ë + K_d ė +
///   K_p e = −M_d Ĥ⁻¹ F. At rest it meets the stiffness Ĥ M_d⁻¹ K_p, which is K_p only where M_d = Ĥ.
///   The impedance that Hogan asks for needs a force sensor for every other M_d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impedance<T, const M: usize> {
    /// K_p and K_d.
    pub tj: TransposeJacobian<T, M>,
    /// M_d⁻¹; `None` leaves the arm its own inertia.
    pub mobility: Option<Gains<T, M>>,
}

lift! { struct Impedance<T, M> { tj, mobility } }

/// law.inertia.
const INERTIA: Parameter = Parameter {
    key: "law.inertia",
    label: "M_d",
    form: Form::Matrix,
    unit: "kg",
    default: Default::Words("the arm's own"),
    help: "Desired inertia of the tip, which the model shapes; without it the law is tj.",
};

impl Declaration for Impedance<f64, MAX_AXES> {
    const DESCRIPTION: Description = Description {
        name: "impedance",
        title: "impedance control",
        equation: "Q̂ = K_p e + K_d ė, or Ĥ (ẍ_d + M_d⁻¹ (K_p e + K_d ė)) + Ĉ",
        parameters: &[KP, KD, INERTIA, super::mass::SCALE],
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
        let inertia = law.find(&INERTIA, axes, |value| Gains::of(value, axes))?;
        Ok(Self {
            tj: TransposeJacobian::read(law, axes)?,
            mobility: inertia.map(|inertia| inertia.inverse()),
        })
    }

    fn check(&self, arm: &ArmSettings, task: &task::Description) -> Result<(), Unsuited> {
        let law = "impedance with law.inertia";
        self.mobility.map_or(Ok(()), |_| mb::check_square(law, arm, task))
    }
}

impl<T: Scalar, const M: usize> Equation<T, M> for Impedance<T, M> {
    #[inline(always)]
    fn command<A: Kinematics<T, N, M>, const N: usize>(
        &self,
        now: &Situation<'_, T, A, N, M>,
        _: &mut State<T>,
        signals: &mut Signals<T>,
    ) -> Command<T, N> {
        let force = self.tj.task_force(now.error);
        let Some(mobility) = &self.mobility else {
            signals[0] = T::zero();
            return Command::of_task_force(&now.jacobian(), &force);
        };
        let (dynamics, damping) = mb::task_dynamics(now);
        let wanted: SVector<T, M> = now.desired.acceleration + mobility.times(&force);
        let force = matrix::times(&dynamics.inertia, &wanted) + dynamics.velocity_terms;
        signals[0] = damping;
        Command { damping, ..Command::of_task_force(&now.jacobian(), &force) }
    }

    fn balances_gravity(&self) -> bool {
        self.mobility.is_some()
    }
}
