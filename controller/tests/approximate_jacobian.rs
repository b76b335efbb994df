//! tj with the Jacobian of the arm's initial posture.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    assert_close, jacobian, joints, mix, rms_mm, scenario, swinging, tracking_error,
    transpose_times,
};
use mtj_controller::Controller;

fn controller(more: &[&str]) -> Controller {
    let law = "law={kind='tj', kp=60, kd=120}";
    Controller::new(&scenario("sampled/mb", &[&[law], more].concat()))
}

#[test]
fn the_torque_takes_the_jacobian_of_the_initial_posture_and_the_error_of_the_true_tip() {
    let start = [0.4, 1.1];
    let mut approximate = controller(&["law.jacobian=initial", "arm.position=[0.4, 1.1]"]);
    for time_ms in [0, 10, 500] {
        let state = swinging(time_ms);
        let (e, rate) = tracking_error(&state);
        let force = mix(60.0, e, 120.0, rate);
        let answer = approximate.respond(&state).unwrap();
        assert_close(&answer.echo, force, "Q̂");
        assert_close(&answer.torque, transpose_times(jacobian(start), force), "τ");
        assert_ne!(joints(&state).0, start);
    }
}

#[test]
fn the_exact_jacobian_is_the_default() {
    let [mut exact, mut plain] = [&["law.jacobian=exact"][..], &[]].map(controller);
    for time_ms in [0, 10, 500] {
        let state = swinging(time_ms);
        assert_eq!(exact.respond(&state).unwrap(), plain.respond(&state).unwrap());
    }
}

#[test]
fn a_turn_of_the_whole_arm_is_lost_with_it() {
    let law = "law={kind='tj', kp=60, kd=120}";
    let exact = rms_mm(&[law], 0);
    assert!(exact < 300.0, "{exact} mm");
    let approximate = rms_mm(&[law, "law.jacobian=initial"], 0);
    assert!(approximate.is_nan() || approximate > 1000.0, "{approximate} mm");
}
