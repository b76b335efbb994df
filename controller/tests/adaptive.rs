//! Adaptive control against the arm by hand and a table of another implementation.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    acceleration, assert_nearly, assert_tabled, bend, desired, jacobian, joints, mix, scenario,
    solve, state, swinging, times, tracking_error,
};
use mtj_controller::Controller;

fn controller(law: &str) -> Controller {
    Controller::new(&scenario("sampled/mb", &[law]))
}

#[test]
fn the_errors_on_the_papers_arm_are_those_of_another_implementation() {
    let law = "law={kind='adaptive', kp=4, kd=40, adaptation=20}";
    assert_tabled(&[law], &[(0, 0.71), (5, 1.49), (10, 2.26), (20, 3.90)], 5e-3);
}

#[test]
fn where_the_joints_move_as_asked_a_model_makes_the_tip_accelerate_as_asked() {
    let law = "law={kind='adaptive', kp=4, kd=40, adaptation=0, initial='model'}";
    for time_ms in [0, 500, 1700] {
        let (q, _) = joints(&swinging(time_ms % 1000));
        let (e, _) = tracking_error(&state(time_ms, q, [0.0; 2]));
        let [_, velocity, wanted] = desired(time_ms as f64 * 1e-3);
        let v = solve(jacobian(q), mix(1.0, velocity, 4.0, e));
        let state = state(time_ms, q, v);
        let torque = controller(law).respond(&state).unwrap().torque;
        let joint = acceleration(q, v, [torque[0], torque[1]]);
        let found = mix(1.0, times(jacobian(q), joint), 1.0, bend(q, v));
        let (_, rate) = tracking_error(&state);
        let expected = mix(1.0, wanted, 4.0, rate);
        let off = mix(1.0, found, -1.0, expected);
        assert!(off[0].hypot(off[1]) < 1e-9, "{time_ms} ms: {found:?} is not {expected:?}");
    }
}

#[test]
fn without_estimates_it_damps_and_an_estimate_grows_with_the_error() {
    let mut learning = controller("law={kind='adaptive', kp=4, kd=[40, 30], adaptation=20}");
    let damper = |time_ms| {
        let state = swinging(time_ms);
        let ((q, v), (e, _)) = (joints(&state), tracking_error(&state));
        let [_, velocity, _] = desired(time_ms as f64 * 1e-3);
        let s = mix(1.0, solve(jacobian(q), mix(1.0, velocity, 4.0, e)), -1.0, v);
        (state, s, [40.0 * s[0], 30.0 * s[1]])
    };
    let (first, _, torque) = damper(0);
    assert_nearly(&learning.respond(&first).unwrap().torque, torque, "p̂ = 0");
    for signal in ["inertia", "moment"] {
        assert_eq!(learning.error().signal(signal).unwrap(), [0.0; 2], "{signal}");
    }
    let (second, s, torque) = damper(10);
    let found = learning.respond(&second).unwrap().torque;
    let of_estimates: f64 = (0..2).map(|i| s[i] * (found[i] - torque[i])).sum();
    // Y p̂ · s = |Yᵀ s|² Γ T.
    let of_parameters: f64 = ["inertia", "moment"]
        .iter()
        .flat_map(|signal| learning.error().signal(signal).unwrap().to_vec())
        .map(|p| p * p / (20.0 * 0.01))
        .sum();
    assert!((of_estimates - of_parameters).abs() < 1e-9, "{of_estimates}, {of_parameters}");
    assert!(of_parameters > 1e-3, "{of_parameters}");
}

#[test]
fn the_model_begins_with_the_textbooks_parameters_times_the_mass_scale() {
    let law = "law={kind='adaptive', kp=4, kd=40, adaptation=20, initial='model', model={mass_scale=1.1}}";
    let mut controller = controller(law);
    controller.respond(&swinging(0)).unwrap();
    // a₁, a₂ and a₃ of the two links.
    let (a1, a2, a3) = (0.333 + 0.30 + 4.0 * 0.25 + 3.0 * 1.25, 0.30 + 3.0 * 0.25, 3.0 * 0.5);
    let shown = |signal| controller.error().signal(signal).unwrap().to_vec();
    assert_nearly(&shown("inertia"), [1.1 * a1, 1.1 * a2], "D");
    assert_nearly(&shown("moment"), [1.1 * (4.0 * 0.5 + 3.0), 1.1 * a3], "b");
}
