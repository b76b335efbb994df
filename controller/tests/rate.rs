//! Resolved motion rate control against the arm by hand and a table of another implementation.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    assert_nearly, assert_tabled, desired, jacobian, joints, mix, scenario, solve, state, swinging,
    tracking_error,
};
use mtj_controller::Controller;

#[test]
fn joints_follow_the_velocity_that_moves_the_tip_as_asked() {
    let law = "law={kind='rate', kp=[4, 5], kd=[40, 30], ki=[7, 9]}";
    let mut controller = Controller::new(&scenario("sampled/mb", &[law]));
    let mut integral = [0.0; 2];
    let instants = [0_u64, 10, 20, 40, 50, 60, 70];
    for (i, time_ms) in instants.into_iter().enumerate() {
        let state = swinging(time_ms);
        let answer = *controller.respond(&state).unwrap();
        let ((q, v), (e, _)) = (joints(&state), tracking_error(&state));
        let [_, velocity, _] = desired(time_ms as f64 * 1e-3);
        let commanded = solve(jacobian(q), mix(1.0, velocity, 1.0, [4.0 * e[0], 5.0 * e[1]]));
        let error = mix(1.0, commanded, -1.0, v);
        let interval = if i == 0 { 0.0 } else { (time_ms - instants[i - 1]) as f64 * 1e-3 };
        integral = mix(1.0, integral, interval, error);
        let torque =
            std::array::from_fn(|j| [40.0, 30.0][j] * error[j] + [7.0, 9.0][j] * integral[j]);
        assert_nearly(&answer.torque, torque, &format!("{time_ms} ms"));
        let shown = controller.error().signal("commanded_velocity").unwrap();
        assert_nearly(shown, commanded, "q̇_c");
    }
}

#[test]
fn the_errors_on_the_papers_arm_are_those_of_another_implementation() {
    let law = "law={kind='rate', kp=4, kd=40}";
    assert_tabled(&[law], &[(0, 52.6), (5, 53.5), (10, 54.5), (20, 56.6)], 2e-3);
}

#[test]
fn a_redundant_arm_moves_its_tip_as_asked_with_the_least_joint_velocity() {
    let law = "law={kind='rate', kp=4, kd=1}";
    let mut controller = Controller::new(&scenario("redundant/mtj", &[law]));
    let q = [0.1, 0.9, 0.7];
    let torque = controller.respond(&state(0, q, [0.0; 3])).unwrap().torque;
    // K_d = 1 and q̇ = 0, so τ = q̇_c. A circle about (0.8, 1.0) of radius 0.3, from its right.
    let (lengths, angle) = ([0.8, 0.7, 0.5], [q[0], q[0] + q[1], q[0] + q[1] + q[2]]);
    let part = |i: usize| [lengths[i] * f64::cos(angle[i]), lengths[i] * f64::sin(angle[i])];
    let lever = |j: usize| (j..3).map(part).fold([0.0; 2], |sum, x| mix(1.0, sum, 1.0, x));
    let column = |j: usize| [-lever(j)[1], lever(j)[0]];
    let e = mix(1.0, [1.1, 1.0], -1.0, lever(0));
    let asked = mix(4.0, e, 1.0, [0.0, 0.3]);
    let found = (0..3).fold([0.0; 2], |sum, j| mix(1.0, sum, torque[j], column(j)));
    assert_nearly(&found, asked, "J q̇_c");
    // What does not move the tip is orthogonal to it.
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let idle =
        [cross(column(1), column(2)), cross(column(2), column(0)), cross(column(0), column(1))];
    let along: f64 = (0..3).map(|j| idle[j] * torque[j]).sum();
    assert!(along.abs() < 1e-12, "{along}");
}
