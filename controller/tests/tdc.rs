//! Time-delay control, and the mass with which it and eq. (11) multiply accelerations, against
//! values worked out by hand in `by_hand`.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    Plane, THREE_LINKS, TWO_LINKS, assert_close, assert_nearly, controller, desired, echoing,
    jacobian, joints, mix, norm, scenario, state, task_inertia, times, tracking_error,
    transpose_times,
};
use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_protocol::sample::{StateSample, text_of};

/// The rows of M̄ at a posture.
type Rows = fn(Plane) -> [Plane; 2];

/// Values of `law.mass` with what they stand for.
const MASSES: [(&str, Rows); 4] = [
    ("law.mass=2.5", |_| [[2.5, 0.0], [0.0, 2.5]]),
    ("law.mass=[2, 3.5]", |_| [[2.0, 0.0], [0.0, 3.5]]),
    ("law.mass=[[2.5, 0.4], [-0.2, 3]]", |_| [[2.5, 0.4], [-0.2, 3.0]]),
    ("law.mass=task-inertia", |q| task_inertia(&TWO_LINKS, q)),
];

/// Where samples are taken, ms; one is missing.
const INSTANTS: [u64; 7] = [0, 10, 20, 40, 50, 60, 70];

/// The law with K_p = 8/s² and K_d = 4/s.
fn tdc(sets: &[&str]) -> Controller {
    let law = ["law.kind=tdc", "law.kp=8", "law.kd=4", "law.factor.kind=constant"];
    controller(&[&law[..], sets].concat())
}

/// The scenario with no table `law.factor`.
fn without_factor(sets: &[&str]) -> Controller {
    let text = built_in("sampled/mtj").unwrap();
    let (before, rest) = text.split_once("[law.factor]").unwrap();
    let (_, after) = rest.split_once("[law.memory]").unwrap();
    let sets = ["law.kind=tdc", "law.kp=8", "law.kd=4", "law.mass=2.5"].iter().chain(sets);
    let sets: Vec<Override> = sets.map(|set| set.parse().unwrap()).collect();
    let text = format!("{before}[law.memory]{after}");
    Controller::new(&Scenario::parse("here", &text, &sets).unwrap())
}

fn seconds(state: &StateSample) -> f64 {
    state.header.time_ns as f64 * 1e-9
}

fn speed(state: &StateSample) -> Plane {
    let (q, v) = joints(state);
    times(jacobian(q), v)
}

/// ẍ_d − a; a is zero at the first sample.
fn missing_acceleration(state: &StateSample, before: Option<&StateSample>) -> Plane {
    let a = before.map_or([0.0; 2], |before| {
        let passed = seconds(state) - seconds(before);
        mix(1.0 / passed, speed(state), -1.0 / passed, speed(before))
    });
    mix(1.0, desired(seconds(state))[2], -1.0, a)
}

/// ẍ_d − a + K_d ė + K_p e.
fn wanted(state: &StateSample, before: Option<&StateSample>) -> Plane {
    let (e, rate) = tracking_error(state);
    mix(1.0, missing_acceleration(state, before), 1.0, mix(8.0, e, 4.0, rate))
}

/// What is remembered, of a state and the force that was sent before.
type Recalled = fn(&StateSample, Plane) -> Plane;

/// The memory policies.
const POLICIES: [(&str, Recalled); 3] = [
    ("law.memory.policy=sent", |_, sent| sent),
    ("law.memory.policy=applied", |state, _| [state.applied[0], state.applied[1]]),
    ("law.memory.policy=delivered", |state, _| [state.delivered[0], state.delivered[1]]),
];

#[test]
fn tdc_adds_to_what_it_remembers_the_mass_times_the_acceleration_it_wants() {
    for (mass, rows) in MASSES {
        for (policy, remembered) in POLICIES {
            let mut controller = tdc(&[mass, policy]);
            let mut before: Option<(StateSample, Plane)> = None;
            for time_ms in INSTANTS {
                let what = format!("{mass}, {policy}, {time_ms} ms");
                let state = echoing(time_ms);
                let answer = *controller.respond(&state).unwrap();
                let (k, memory) = match &before {
                    None => (0.0, [0.0; 2]),
                    Some((_, sent)) => (1.0, remembered(&state, *sent)),
                };
                let wanted = wanted(&state, before.as_ref().map(|(state, _)| state));
                let (q, _) = joints(&state);
                let force = mix(1.0, memory, 1.0, times(rows(q), wanted));
                assert_nearly(&answer.echo, force, &what);
                assert_nearly(&answer.torque, transpose_times(jacobian(q), force), &what);
                assert_eq!(answer.echo_count, 2, "{what}");
                let shown = controller.error();
                assert_eq!(text_of(&shown.law), "tdc");
                assert_eq!(shown.signal("factor").unwrap(), [k; 2], "{what}");
                assert_close(shown.signal("memory").unwrap(), memory, &what);
                before = Some((state, [answer.echo[0], answer.echo[1]]));
            }
        }
    }
}

#[test]
fn the_first_answer_of_tdc_has_neither_memory_nor_acceleration() {
    for (policy, _) in POLICIES {
        let mut controller = tdc(&["law.mass=2.5", policy]);
        let first = echoing(500);
        let (e, rate) = tracking_error(&first);
        let wanted = mix(1.0, desired(0.5)[2], 1.0, mix(8.0, e, 4.0, rate));
        let answer = controller.respond(&first).unwrap();
        assert_close(&answer.echo, mix(2.5, wanted, 0.0, [0.0; 2]), policy);
    }
}

/// The first two answers, and k at the second.
fn regulated(mut controller: Controller) -> Plane {
    controller.respond(&echoing(0)).unwrap();
    let echo = controller.respond(&echoing(10)).unwrap().echo;
    let shown = *controller.error();
    let k = shown.signal("factor").unwrap();
    let held = echoing(10).delivered;
    let memory = [k[0] * held[0], k[1] * held[1]];
    assert_close(shown.signal("memory").unwrap(), memory, "h");
    let wanted = wanted(&echoing(10), Some(&echoing(0)));
    assert_nearly(&echo, mix(1.0, memory, 2.5, wanted), "k scales the memory alone");
    [k[0], k[1]]
}

#[test]
fn tdc_trusts_its_memory_wholly_unless_law_factor_says_otherwise() {
    let delivered = "law.memory.policy=delivered";
    let k = |sets: &[&str]| regulated(without_factor(&[&[delivered], sets].concat()));
    assert_eq!(k(&[]), [1.0; 2], "no law.factor");
    assert_eq!(k(&["law.factor.ceiling=0.9"]), [0.9; 2], "a ceiling alone");
    assert_eq!(k(&["law.factor.error=1e-6"]), [1.0; 2], "thresholds that nothing is held against");
    let (e, rate) = tracking_error(&echoing(10));
    let expected = (-(norm(e) / 0.4 + norm(rate) / 10.0)).exp();
    let found = k(&["law.factor.kind=exponential", "law.factor.error=0.4"]);
    assert_close(&found, [expected; 2], "eq. (15a) with the paper's threshold for the rate");
    let found = k(&["law.factor.kind=switch", "law.factor.error=1e-6"]);
    assert_eq!(found, [0.0; 2], "eq. (14)");
}

#[test]
fn the_task_inertia_of_a_redundant_arm_is_that_of_its_model() {
    let answers = |mass: &str, scale: &str| {
        let sets = [
            "law.kind=tdc",
            "law.kp=8",
            "law.kd=4",
            "law.factor.kind=constant",
            "law.memory.policy=delivered",
            &format!("law.mass={mass}"),
            &format!("law.model.mass_scale={scale}"),
        ];
        let mut controller = Controller::new(&scenario("redundant/mtj", &sets));
        [(0, 0.0), (2, 0.02), (4, 0.05), (6, 0.11)].map(|(time_ms, bend)| {
            let q = [0.1 + bend, 0.9 - 2.0 * bend, 0.7 + 3.0 * bend];
            let mut state = state(time_ms, q, [1.0 + bend, -2.0, 0.5 - 9.0 * bend]);
            state.delivered[..2].copy_from_slice(&[3.0, -4.0]);
            let held = if time_ms == 0 { [0.0; 2] } else { [3.0, -4.0] };
            let echo = controller.respond(&state).unwrap().echo;
            (q, mix(1.0, [echo[0], echo[1]], -1.0, held))
        })
    };
    let of_unit_mass = answers("1", "1.0");
    for (scale, factor) in [("1.0", 1.0), ("1.25", 1.25)] {
        for ((q, wanted), (_, found)) in of_unit_mass.iter().zip(answers("task-inertia", scale)) {
            let expected =
                mix(factor, times(task_inertia(&THREE_LINKS, *q), *wanted), 0.0, [0.0; 2]);
            assert_nearly(&found, expected, &format!("q = {q:?}, scale {scale}"));
        }
    }
}

#[test]
fn eq_11_multiplies_the_error_of_the_acceleration_with_the_mass_and_not_with_k() {
    // k is 0, somewhere between, and 1.
    type Factor = fn(Plane, Plane) -> f64;
    let factors: [(&[&str], Factor); 3] = [
        (&["law.factor.kind=switch", "law.factor.error=1e-9"], |_, _| 0.0),
        (&["law.factor.ceiling=0.9"], |e, rate| 0.9 * (-(norm(e) + norm(rate) / 10.0)).exp()),
        (&["law.factor.kind=constant"], |_, _| 1.0),
    ];
    for (mass, rows) in MASSES {
        for (factor, k) in factors {
            let sets = ["law.acceleration=true", "law.memory.policy=applied", mass];
            let mut controller = controller(&[&sets[..], factor].concat());
            let mut before: Option<StateSample> = None;
            for time_ms in INSTANTS {
                let what = format!("{mass}, {factor:?}, {time_ms} ms");
                let state = echoing(time_ms);
                let (e, rate) = tracking_error(&state);
                let k = if before.is_none() { 0.0 } else { k(e, rate) };
                let term = missing_acceleration(&state, before.as_ref());
                let term = times(rows(joints(&state).0), term);
                let held = [state.applied[0], state.applied[1]];
                let expected = mix(1.0, mix(30.0, e, 60.0, rate), 1.0, mix(1.0, term, k, held));
                assert_nearly(&controller.respond(&state).unwrap().echo, expected, &what);
                assert_close(controller.error().signal("factor").unwrap(), [k; 2], &what);
                before = Some(state);
            }
        }
    }
}

#[test]
fn the_mass_of_eq_11_is_one_unless_the_scenario_says_otherwise() {
    let answers = |sets: &[&str]| {
        let mut controller = controller(sets);
        INSTANTS.map(|time_ms| *controller.respond(&echoing(time_ms)).unwrap())
    };
    let term = "law.acceleration=true";
    assert_eq!(answers(&[term, "law.mass=1"]), answers(&[term]));
    assert_ne!(answers(&[term, "law.mass=2"]), answers(&[term]));
    assert_eq!(answers(&["law.mass=2"]), answers(&[]), "the term is not asked for");
}

#[test]
fn a_task_inertia_near_a_singular_posture_is_damped_and_says_so() {
    let tdc = ["law.kind=tdc", "law.kp=8", "law.kd=4"];
    for (law, sets) in [("tdc", &tdc[..]), ("mtj", &["law.acceleration=true"])] {
        let mut inverting = controller(&[sets, &["law.mass=task-inertia"]].concat());
        for fold in [0.0, 1e-12, 0.01, std::f64::consts::PI] {
            for shoulder in [0.3, -1.1, 2.0] {
                let answer = inverting.respond(&state(2500, [shoulder, fold], [1.0, 1.0])).unwrap();
                let largest = answer.torque.iter().fold(0.0, |most, t| f64::max(most, t.abs()));
                assert!(largest < 2e4, "{law}, q = [{shoulder}, {fold}]: {largest} N m");
                assert!(inverting.is_damped(), "{law}, q = [{shoulder}, {fold}]");
            }
        }
        inverting.respond(&state(2510, [0.3, 0.8], [1.0, 1.0])).unwrap();
        assert!(!inverting.is_damped(), "{law}: elsewhere it is not");
    }
}
