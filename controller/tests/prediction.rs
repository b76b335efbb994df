//! The model predictor against tables of another implementation.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{assert_close, assert_tabled, controller, echoing, rms_mm, scenario, state};
use mtj_controller::Controller;

const MB: &str = "law={kind='mb', kp=8, kd=4, prediction={horizon='measured', model='rigid-body'}}";

#[test]
fn with_a_perfect_model_latency_makes_no_difference() {
    assert_tabled(&[MB], &[0, 5, 10, 20, 30, 40, 60, 100].map(|latency| (latency, 2.54)), 5e-3);
}

#[test]
fn a_horizon_may_be_given() {
    for latency_ms in [5, 20, 37] {
        let horizon = format!("law.prediction.horizon={latency_ms}ms");
        let found = rms_mm(&[MB, &horizon], latency_ms);
        assert!((found - 2.54).abs() < 0.02, "{latency_ms} ms: {found} mm");
    }
}

#[test]
fn with_a_model_that_is_ten_percent_off_the_error_grows_with_latency() {
    let table = [
        (0, 20.4),
        (5, 20.8),
        (10, 21.3),
        (20, 22.2),
        (30, 23.1),
        (40, 24.1),
        (60, 26.0),
        (100, 30.0),
    ];
    assert_tabled(&[MB, "law.model.mass_scale=1.1"], &table, 2e-2);
}

#[test]
fn without_a_horizon_the_model_predicts_nothing() {
    for law in ["law.kind=mb", "law.kind=mtj"] {
        let [mut plain, mut model] = ["kinematic", "rigid-body"]
            .map(|model| controller(&[law, &format!("law.prediction.model={model}")]));
        for time_ms in [0, 10, 20] {
            let state = echoing(time_ms);
            assert_eq!(model.respond(&state).unwrap(), plain.respond(&state).unwrap());
        }
    }
}

#[test]
fn a_model_of_an_arm_at_rest_without_torque_predicts_rest() {
    let law = "law={kind='tj', kp=60, kd=120, prediction={horizon='30 ms', model='rigid-body'}}";
    let mut controller = Controller::new(&scenario("sampled/mb", &[law]));
    let mut later = Controller::new(&scenario("sampled/mb", &["law={kind='tj', kp=60, kd=120}"]));
    // The first answer aims at the desired motion 30 ms on, with the arm as it is.
    let found = controller.respond(&state(0, [0.1, 1.4], [0.0; 2])).unwrap().torque;
    let expected = later.respond(&state(30, [0.1, 1.4], [0.0; 2])).unwrap().torque;
    assert_close(&found, [expected[0], expected[1]], "τ");
}
