//! The disturbance observer: time-delay control with a filter of one sample, and a filter by hand.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    Plane, assert_nearly, assert_tabled, controller, desired, echoing, jacobian, joints, mix,
    times, tracking_error,
};
use mtj_protocol::sample::StateSample;

const INSTANTS: [u64; 7] = [0, 10, 20, 40, 50, 60, 70];

#[test]
fn with_a_filter_of_one_sample_it_is_time_delay_control() {
    let gains = ["law.kp=8", "law.kd=4", "law.factor.kind=constant"];
    for filter in ["law.filter=10ms", "law.filter=1ms"] {
        for mass in ["1", "2.5", "[2, 3.5]", "[[2.5, 0.4], [-0.2, 3]]", "task-inertia"] {
            for policy in ["sent", "applied", "delivered"] {
                let mass = format!("law.mass={mass}");
                let policy = format!("law.memory.policy={policy}");
                let common = [&gains[..], &[&mass, &policy, filter]].concat();
                let [mut dob, mut tdc] = ["law.kind=dob", "law.kind=tdc"]
                    .map(|kind| controller(&[&common[..], &[kind]].concat()));
                for time_ms in INSTANTS {
                    let state = echoing(time_ms);
                    let expected = *tdc.respond(&state).unwrap();
                    let found = *dob.respond(&state).unwrap();
                    let what = format!("{mass}, {policy}, {filter}, {time_ms} ms");
                    assert_nearly(&found.echo, [expected.echo[0], expected.echo[1]], &what);
                    assert_nearly(&found.torque, [expected.torque[0], expected.torque[1]], &what);
                }
            }
        }
    }
}

fn speed(state: &StateSample) -> Plane {
    let (q, v) = joints(state);
    times(jacobian(q), v)
}

#[test]
fn a_slower_filter_takes_its_time() {
    let law = "law={kind='dob', kp=8, kd=4, mass=2.5, filter='40 ms', memory={policy='delivered'}}";
    let mut controller = controller(&[law]);
    let (mut disturbance, mut before): (_, Option<StateSample>) = ([0.0; 2], None);
    for time_ms in INSTANTS {
        let state = echoing(time_ms);
        if let Some(before) = &before {
            let passed = (state.header.time_ns - before.header.time_ns) as f64 * 1e-9;
            let a = mix(1.0 / passed, speed(&state), -1.0 / passed, speed(before));
            let force = [state.delivered[0], state.delivered[1]];
            let gain = passed / 0.04;
            disturbance = mix(1.0 - gain, disturbance, gain, mix(1.0, force, -2.5, a));
        }
        let (e, rate) = tracking_error(&state);
        let wanted = mix(1.0, desired(time_ms as f64 * 1e-3)[2], 1.0, mix(8.0, e, 4.0, rate));
        let found = controller.respond(&state).unwrap().echo;
        assert_nearly(&found, mix(2.5, wanted, 1.0, disturbance), &format!("{time_ms} ms"));
        assert_nearly(controller.error().signal("disturbance").unwrap(), disturbance, "d̂");
        before = Some(state);
    }
}

#[test]
fn the_errors_of_a_filter_of_one_sample_are_those_tabled_for_time_delay_control() {
    let law =
        "law={kind='dob', kp=20, kd=20, mass=1.5, filter='10 ms', memory={policy='delivered'}}";
    assert_tabled(&[law], &[(0, 2.33), (5, 3.88), (10, 5.45), (20, 8.90)], 5e-3);
}
