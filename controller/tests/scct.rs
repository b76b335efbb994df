//! Simplified computed torque: against the arm by hand, and against computed torque on an arm for which
//! the two are one.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    assert_nearly, desired, jacobian, joints, mix, scenario, solve, swinging, tracking_error,
};
use mtj_controller::{
    Controller,
    responder::{Context, Measured, Responder},
};
use mtj_model::{
    MAX_JOINTS, MAX_SIGNALS, MAX_STATE,
    arm::{Arm, Kinematics},
    gains::{Gains, JointGains},
    law::{Equation, mb::ModelBased, scct::SimplifiedComputedTorque},
    task::Previous,
    trajectory::{Circle, Path},
};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

#[test]
fn each_joint_gets_the_torque_for_its_part_of_the_acceleration() {
    let law = "law={kind='scct', kp=[8, 9], kd=4, inertia=[5, 2]}";
    let mut controller = Controller::new(&scenario("sampled/mb", &[law]));
    for time_ms in [0, 10, 20, 40] {
        let state = swinging(time_ms);
        let ((q, _), (e, rate)) = (joints(&state), tracking_error(&state));
        let [_, _, acceleration] = desired(time_ms as f64 * 1e-3);
        let gains = mix(1.0, [8.0 * e[0], 9.0 * e[1]], 4.0, rate);
        let joint = solve(jacobian(q), mix(1.0, acceleration, 1.0, gains));
        let answer = controller.respond(&state).unwrap();
        assert_nearly(&answer.torque, [5.0 * joint[0], 2.0 * joint[1]], "τ");
    }
}

/// Two geared joints, H = diag(5, 2) and C = 0, that move a carriage along oblique rails: x = A q.
#[derive(Clone, Copy)]
struct Geared;

const RAILS: Matrix2<f64> = Matrix2::new(1.0, 0.4, -0.3, 0.8);

impl Arm<f64, 2> for Geared {
    type Configuration = [Vector2<f64>; 2];

    fn configuration(q: &Vector2<f64>, q_dot: &Vector2<f64>) -> Self::Configuration {
        [*q, *q_dot]
    }
    fn combine(
        one: &Self::Configuration,
        other: &Self::Configuration,
        choose: impl Fn(f64, f64) -> f64,
    ) -> Self::Configuration {
        std::array::from_fn(|i| one[i].zip_map(&other[i], &choose))
    }
    fn inertia(&self, _: &Self::Configuration) -> Matrix2<f64> {
        Matrix2::from_diagonal(&Vector2::new(5.0, 2.0))
    }
    fn velocity_terms(&self, _: &Self::Configuration) -> Vector2<f64> {
        Vector2::zeros()
    }
    fn acceleration(&self, at: &Self::Configuration, force: &Vector2<f64>) -> Vector2<f64> {
        force.component_div(&self.inertia(at).diagonal())
    }
}

impl Kinematics<f64, 2, 2> for Geared {
    type Point = Vector2<f64>;

    fn tip(&self, [q, _]: &[Vector2<f64>; 2]) -> Vector2<f64> {
        RAILS * q
    }
    fn tip_velocity(&self, [_, q_dot]: &[Vector2<f64>; 2]) -> SVector<f64, 2> {
        RAILS * q_dot
    }
    fn jacobian(&self, _: &[Vector2<f64>; 2]) -> SMatrix<f64, 2, 2> {
        RAILS
    }
    fn jacobian_rate_velocity(&self, _: &[Vector2<f64>; 2]) -> SVector<f64, 2> {
        Vector2::zeros()
    }
}

fn torque<L: Equation<f64, 2>>(law: L, time: f64) -> Vector2<f64> {
    let circle =
        Circle { center: Vector2::new(0.1, 0.2), radius: 0.7, angular_frequency: 1.3, phase: 0.4 };
    let responder = Responder { arm: Geared, trajectory: Path::Circle(circle).into(), law };
    let (q, v) = (Vector2::new(0.3 + time, -time), Vector2::new(1.0, 2.0 * time));
    let at = Geared::configuration(&q, &v);
    let measured = Measured { time, position: &q, velocity: &v, at: &at, ahead: None };
    let context =
        Context { previous: Previous::none(), horizon: None, echo: None, precomputed: None };
    let (mut kept, mut unseen) = ([0.0; MAX_STATE], [0.0; MAX_SIGNALS]);
    responder.respond(&measured, &context, &mut kept, &mut unseen).command.torque
}

#[test]
fn with_an_arm_that_is_as_the_law_takes_it_for_it_is_computed_torque() {
    let gains = |gain: f64| Gains::<f64, 2>::Diagonal(SVector::repeat(gain));
    let (kp, kd) = (gains(8.0), gains(4.0));
    let mut each = [1.0; MAX_JOINTS];
    each[..2].copy_from_slice(&[5.0, 2.0]);
    for time in [0.0, 0.3, 1.7] {
        let inertia = JointGains { each };
        let simplified = torque(SimplifiedComputedTorque { kp, kd, inertia }, time);
        let full = torque(ModelBased { kp, kd }, time);
        assert!((simplified - full).norm() < 1e-12 * full.norm(), "{simplified} is not {full}");
    }
}
