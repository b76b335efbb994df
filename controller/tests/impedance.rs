//! Impedance control: tj without a desired inertia, computed torque with one.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{assert_close, scenario, state, swinging};
use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, built_in};

const INSTANTS: [u64; 7] = [0, 10, 20, 40, 50, 60, 70];

fn controller(law: &str) -> Controller {
    Controller::new(&scenario("sampled/mb", &[law]))
}

#[test]
fn without_a_desired_inertia_it_is_tj_bit_for_bit() {
    for gains in ["kp=60, kd=120", "kp=[60, 50], kd=[[120, 3], [4, 110]]"] {
        let [mut impedance, mut tj] =
            ["impedance", "tj"].map(|kind| controller(&format!("law={{kind='{kind}', {gains}}}")));
        for time_ms in INSTANTS {
            let state = swinging(time_ms);
            let ours = *impedance.respond(&state).unwrap();
            assert_eq!(ours, *tj.respond(&state).unwrap(), "{gains}, {time_ms} ms");
            assert_eq!(impedance.error().signal("damping").unwrap(), [0.0]);
        }
    }
}

#[test]
fn with_one_it_is_computed_torque_with_gains_for_each_kilogram() {
    let pairs = [
        ("inertia=2.5, kp=20, kd=10", "kp=8, kd=4"),
        ("inertia=[2, 4], kp=[16, 40], kd=[8, 12]", "kp=[8, 10], kd=[4, 3]"),
        ("inertia=[[2, 1], [1, 3]], kp=[[16, 8], [8, 24]], kd=[[8, 4], [4, 12]]", "kp=8, kd=4"),
    ];
    for (impedance, mb) in pairs {
        let mut shaped = controller(&format!("law={{kind='impedance', {impedance}}}"));
        let mut mb = controller(&format!("law={{kind='mb', {mb}}}"));
        for time_ms in INSTANTS {
            let state = swinging(time_ms);
            let expected = mb.respond(&state).unwrap().torque;
            let found = shaped.respond(&state).unwrap();
            assert_close(&found.torque, [expected[0], expected[1]], impedance);
        }
        assert_eq!(shaped.error().signal("damping").unwrap(), [0.0]);
        shaped.respond(&state(80, [0.3, 1e-9], [0.1, 0.1])).unwrap();
        assert!(shaped.is_damped(), "near a singular posture");
    }
}

#[test]
fn a_redundant_arm_has_an_impedance_and_no_desired_inertia() {
    let load = |law: &str| {
        let set: Override = law.parse().unwrap();
        Scenario::parse("redundant/mtj", built_in("redundant/mtj").unwrap(), &[set])
    };
    assert!(load("law={kind='impedance', kp=60, kd=120}").is_ok());
    let refused = load("law={kind='impedance', kp=60, kd=120, inertia=2}").unwrap_err().to_string();
    for word in ["law.kind", "law.inertia", "3 joints", "2 task axes"] {
        assert!(refused.contains(word), "'{word}' in: {refused}");
    }
}
