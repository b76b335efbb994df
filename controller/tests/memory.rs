//! What mtj remembers, and where the laws aim.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    Plane, assert_close, assert_nearly, controller, desired, echoing, jacobian, joints, mix,
    swinging, times, tip, tracking_error,
};
use mtj_protocol::sample::StateSample;

/// k = 1 whatever the error: what mtj adds is the memory itself.
const TRUSTING: [&str; 3] =
    ["law.factor.kind=switch", "law.factor.error=1e9", "law.factor.error_rate=1e9"];

fn trusting(sets: &[&str]) -> mtj_controller::Controller {
    controller(&[&TRUSTING[..], sets].concat())
}

#[test]
fn sent_holds_the_answer_before() {
    let mut controller = trusting(&["law.memory.policy=sent"]);
    let mut previous: Option<Plane> = None;
    for k in 0..20 {
        let state = echoing(10 * k);
        let force = controller.respond(&state).unwrap().echo;
        let (e, rate) = tracking_error(&state);
        let memory = previous.unwrap_or_default();
        assert_close(controller.error().signal("memory").unwrap(), memory, "h");
        assert_close(&force, mix(1.0, mix(30.0, e, 60.0, rate), 1.0, memory), "Q̂");
        previous = Some([force[0], force[1]]);
    }
}

#[test]
fn a_latched_answer_serves_from_the_next_sample_to_the_next_multiple() {
    let mut controller = trusting(&["law.memory.policy=sent", "law.memory.step=40ms"]);
    let mut answers: Vec<Plane> = Vec::new();
    for k in 0..17 {
        let force = controller.respond(&echoing(10 * k as u64)).unwrap().echo;
        // At 10 to 40 ms the answer of 0 ms serves, at 50 to 80 ms that of 40 ms.
        let memory = if k == 0 { [0.0; 2] } else { answers[(k - 1) / 4 * 4] };
        assert_close(
            controller.error().signal("memory").unwrap(),
            memory,
            &format!("h at sample {k}"),
        );
        answers.push([force[0], force[1]]);
    }
    assert!(answers[4] != answers[0]);
}

#[test]
fn applied_and_delivered_come_from_the_plant() {
    for (policy, of_plant) in [
        (
            "law.memory.policy=applied",
            (|s| [s.applied[0], s.applied[1]]) as fn(&StateSample) -> Plane,
        ),
        ("law.memory.policy=delivered", |s| [s.delivered[0], s.delivered[1]]),
    ] {
        let mut controller = trusting(&[policy]);
        controller.respond(&echoing(0)).unwrap();
        for k in 1..10 {
            let state = echoing(10 * k);
            let force = controller.respond(&state).unwrap().echo;
            let (e, rate) = tracking_error(&state);
            assert_close(controller.error().signal("memory").unwrap(), of_plant(&state), policy);
            let expected = mix(1.0, mix(30.0, e, 60.0, rate), 1.0, of_plant(&state));
            assert_close(&force, expected, policy);
        }
    }
}

#[test]
fn a_standby_controller_answers_as_the_old_one_would_from_its_second_sample_on() {
    for policy in ["law.memory.policy=applied", "law.memory.policy=delivered"] {
        let (mut old, mut standby) = (controller(&[policy]), controller(&[policy]));
        for k in 0..30 {
            old.respond(&echoing(10 * k)).unwrap();
        }
        let state = echoing(300);
        let differs =
            old.respond(&state).unwrap().torque != standby.respond(&state).unwrap().torque;
        assert!(differs, "its first answer is plain tj");
        for k in 31..60 {
            let state = echoing(10 * k);
            assert_eq!(old.respond(&state).unwrap(), standby.respond(&state).unwrap(), "{policy}");
        }
    }
    let (mut old, mut standby) = (trusting(&[]), trusting(&[]));
    for k in 0..30 {
        old.respond(&echoing(10 * k)).unwrap();
    }
    standby.respond(&echoing(300)).unwrap();
    old.respond(&echoing(300)).unwrap();
    let state = echoing(310);
    assert!(
        old.respond(&state).unwrap() != standby.respond(&state).unwrap(),
        "what was sent is known only to who sent it"
    );
}

/// e and ė as a law that aims `d` seconds ahead sees them.
fn predicted_error(state: &StateSample, before: Option<&StateSample>, d: f64) -> (Plane, Plane) {
    let speed = |state: &StateSample| {
        let (q, v) = joints(state);
        times(jacobian(q), v)
    };
    let seconds = |state: &StateSample| state.header.time_ns as f64 * 1e-9;
    let a = before.map_or([0.0; 2], |before| {
        let passed = seconds(state) - seconds(before);
        mix(1.0 / passed, speed(state), -1.0 / passed, speed(before))
    });
    let position = mix(1.0, mix(1.0, tip(joints(state).0), d, speed(state)), d * d / 2.0, a);
    let velocity = mix(1.0, speed(state), d, a);
    let [there, moving, _] = desired(seconds(state) + d);
    (mix(1.0, there, -1.0, position), mix(1.0, moving, -1.0, velocity))
}

#[test]
fn a_fixed_horizon_aims_that_far_ahead() {
    let mut controller = controller(&["law.kind=tj", "law.prediction.horizon=25ms"]);
    let mut before = None;
    for k in 0..10 {
        let state = swinging(10 * k);
        let force = controller.respond(&state).unwrap().echo;
        let (e, rate) = predicted_error(&state, before.as_ref(), 0.025);
        assert_nearly(&controller.error().error, e, "e");
        assert_nearly(&controller.error().error_rate, rate, "ė");
        assert_nearly(&force, mix(30.0, e, 60.0, rate), "Q̂");
        before = Some(state);
    }
}

#[test]
fn a_measured_horizon_is_the_latency_that_the_plant_echoes() {
    let mut controller = controller(&["law.kind=tj", "law.prediction.horizon=measured"]);
    let mut before = None;
    for (k, latency_ns) in [0, 0, 3_000_000, 17_500_000, 1].into_iter().enumerate() {
        let mut state = swinging(10 * k as u64);
        state.latency_ns = latency_ns;
        controller.respond(&state).unwrap();
        let (e, rate) = predicted_error(&state, before.as_ref(), latency_ns as f64 * 1e-9);
        assert_nearly(&controller.error().error, e, "e");
        assert_nearly(&controller.error().error_rate, rate, "ė");
        before = Some(state);
    }
}

#[test]
fn the_difference_spans_the_time_that_really_passed() {
    let mut controller = controller(&["law.kind=tj", "law.prediction.horizon=5ms"]);
    let mut before = None;
    for time_ms in [0, 10, 40, 50] {
        let state = swinging(time_ms);
        controller.respond(&state).unwrap();
        let (e, rate) = predicted_error(&state, before.as_ref(), 0.005);
        assert_nearly(&controller.error().error, e, "e, though samples were lost");
        assert_nearly(&controller.error().error_rate, rate, "ė, though samples were lost");
        before = Some(state);
    }
}

#[test]
fn mb_aims_with_the_desired_acceleration_of_the_instant_it_aims_at() {
    let sets = ["law.kind=mb", "law.kp=8", "law.kd=4", "law.prediction.horizon=30ms"];
    let mut controller = controller(&sets);
    let state = swinging(700);
    let answer = controller.respond(&state).unwrap();
    let (q, v) = joints(&state);
    let joint = by_hand::acceleration(q, v, [answer.torque[0], answer.torque[1]]);
    let found = mix(1.0, times(jacobian(q), joint), 1.0, by_hand::bend(q, v));
    let (e, rate) = predicted_error(&state, None, 0.03);
    let [_, _, wanted] = desired(0.73);
    assert_nearly(&found, mix(1.0, mix(8.0, e, 4.0, rate), 1.0, wanted), "the tip's acceleration");
}

#[test]
fn a_change_of_scenario_keeps_the_memory() {
    for sets in [
        &["law.memory.policy=sent"][..],
        &["law.memory.policy=sent", "law.memory.step=40ms"],
        &["law.memory.policy=delivered", "law.prediction.horizon=5ms"],
        &["law.kind=tj", "law.prediction.horizon=measured"],
    ] {
        let scenario = by_hand::scenario("sampled/mtj", &[&TRUSTING[..], sets].concat());
        let [mut steady, mut changing] = [0; 2].map(|_| mtj_controller::Controller::new(&scenario));
        for k in 0..20 {
            let state = echoing(10 * k);
            if k % 3 == 2 {
                changing.reconfigure(&scenario);
            }
            assert_eq!(changing.respond(&state), steady.respond(&state), "{sets:?}, sample {k}");
        }
    }
}

#[test]
fn a_law_without_memory_leaves_an_empty_one() {
    let mut controller = trusting(&["law.kind=tj"]);
    let mtj = by_hand::scenario("sampled/mtj", &TRUSTING);
    controller.respond(&echoing(0)).unwrap();
    controller.reconfigure(&mtj);
    controller.respond(&echoing(10)).unwrap();
    assert_eq!(
        controller.error().signal("memory").unwrap(),
        [0.0; 2],
        "k = 0 at the first sample of a memory"
    );
    controller.respond(&echoing(20)).unwrap();
    assert!(controller.error().signal("memory").unwrap() != [0.0; 2]);
}
