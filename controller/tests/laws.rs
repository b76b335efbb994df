//! The laws of the paper against values worked out by hand in `by_hand`.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{
    Plane, acceleration, assert_close, bend, controller, desired, jacobian, joints, mix, norm,
    scenario, state, swinging, times, tracking_error, transpose_times,
};
use mtj_controller::{Controller, LawError};
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_protocol::sample::{Echo, StateSample, VERSION, text_of};

const POSTURES: [(Plane, Plane); 3] =
    [([0.03, 1.57], [1.5, -1.0]), ([-0.4, 0.9], [0.2, 2.0]), ([2.0, -1.2], [-0.7, 0.1])];

fn states() -> Vec<StateSample> {
    let at = |(i, (q, v)): (usize, &(Plane, Plane))| state(1370 * i as u64, *q, *v);
    POSTURES.iter().enumerate().map(at).collect()
}

#[test]
fn tj_is_springs_and_dampers_at_the_tip() {
    for state in states() {
        let mut controller = controller(&["law.kind=tj", "law.kp=150", "law.kd=300"]);
        let answer = controller.respond(&state).unwrap();
        let (e, rate) = tracking_error(&state);
        let force = mix(150.0, e, 300.0, rate);
        assert_close(&answer.echo, force, "Q̂");
        assert_close(&answer.torque, transpose_times(jacobian(joints(&state).0), force), "τ");
        assert_close(&controller.error().error, e, "e");
        assert_close(&controller.error().error_rate, rate, "ė");
        assert_eq!(text_of(&controller.error().law), "tj");
    }
}

#[test]
fn gains_may_be_diagonal_or_full() {
    let state = states()[1];
    let respond = |kp: &str, kd: &str| {
        let sets = ["law.kind=tj", &format!("law.kp={kp}"), &format!("law.kd={kd}")];
        *controller(&sets).respond(&state).unwrap()
    };
    let (e, rate) = tracking_error(&state);
    let diagonal = respond("[30, 40]", "[60, 70]");
    assert_close(&diagonal.echo, [30.0 * e[0] + 60.0 * rate[0], 40.0 * e[1] + 70.0 * rate[1]], "Q̂");
    let as_full = respond("[[30, 0], [0, 40]]", "[[60, 0], [0, 70]]");
    assert_eq!(diagonal, as_full, "a full matrix with a zero off its diagonal");
    let full = respond("[[30, 5], [-2, 40]]", "[[60, 7], [3, 70]]");
    let spring = times([[30.0, 5.0], [-2.0, 40.0]], e);
    let damper = times([[60.0, 7.0], [3.0, 70.0]], rate);
    assert_close(&full.echo, mix(1.0, spring, 1.0, damper), "rows are rows");
}

#[test]
fn an_answer_says_what_it_answers() {
    let mut asked = states()[2];
    (asked.sent_ns, asked.header.run, asked.header.sequence) = (77, 5, 1234);
    let mut controller = controller(&[]);
    let answer = *controller.respond(&asked).unwrap();
    assert_eq!((answer.header, answer.header.version), (asked.header, VERSION));
    assert_eq!(answer.state_sent_ns, 77);
    assert_eq!(controller.error().header, asked.header);
    let again = controller.answer_again(&StateSample { sent_ns: 99, ..asked });
    assert_eq!((again.torque, again.state_sent_ns), (answer.torque, 99));
}

#[test]
fn preprocessing_changes_no_answer() {
    for set in ["none", "3ms", "measured"] {
        let set = format!("law.prediction.horizon={set}");
        let (mut preprocessing, mut other) = (controller(&[&set]), controller(&[&set]));
        // The next sample is mostly of the instant that was to be expected, and sometimes of
        // another.
        for (k, late) in
            [0, 10, 20, 30, 41, 51, 61, 71, 71, 90].into_iter().zip([3, 3, 0, 5].repeat(3))
        {
            let state = StateSample { latency_ns: late * 1_000_000, ..swinging(k) };
            let answer = *preprocessing.respond(&state).unwrap();
            assert_eq!(answer, *other.respond(&state).unwrap(), "{set}, {k} ms");
            assert_eq!(preprocessing.error(), other.error(), "{set}, {k} ms");
            preprocessing.preprocess(&state);
        }
    }
}

/// The second answer of mtj, the force of the first, and the second state's errors.
fn second_answer(sets: &[&str]) -> (Controller, Echo, Plane, Plane, Plane) {
    let mut controller = controller(sets);
    let first = *controller.respond(&swinging(0)).unwrap();
    let second = *controller.respond(&swinging(10)).unwrap();
    let (e, rate) = tracking_error(&swinging(10));
    (controller, second.echo, [first.echo[0], first.echo[1]], e, rate)
}

fn assert_regulated(sets: &[&str], k: impl Fn(Plane, Plane) -> Plane) {
    let (controller, force, previous, e, rate) = second_answer(sets);
    let k = k(e, rate);
    let memory = [k[0] * previous[0], k[1] * previous[1]];
    let tj = mix(30.0, e, 60.0, rate);
    assert_close(&force, mix(1.0, tj, 1.0, memory), "Q̂");
    assert_close(controller.error().signal("factor").unwrap(), k, "k");
    assert_close(controller.error().signal("memory").unwrap(), memory, "h");
    assert_eq!(text_of(&controller.error().law), "mtj");
}

#[test]
fn the_first_answer_of_mtj_is_plain_tj_under_every_memory() {
    for policy in ["sent", "applied", "delivered"] {
        for kind in ["switch", "exponential", "diagonal"] {
            let policy = format!("law.memory.policy={policy}");
            let sets = [&policy, &format!("law.factor.kind={kind}")];
            let mut controller = controller(&sets.map(String::as_str));
            let mut first = swinging(500);
            (first.applied, first.delivered) = ([11.0; 7], [-13.0; 7]);
            let (e, rate) = tracking_error(&first);
            let answer = controller.respond(&first).unwrap();
            assert_close(&answer.echo, mix(30.0, e, 60.0, rate), "Q̂");
            assert_close(controller.error().signal("factor").unwrap(), [0.0; 2], "k");
            assert_close(controller.error().signal("memory").unwrap(), [0.0; 2], "h");
        }
    }
}

#[test]
fn eq_14_trusts_the_memory_wholly_or_not_at_all() {
    let (_, _, _, e, rate) = second_answer(&[]);
    let kind = "law.factor.kind=switch";
    let with = |error: f64, error_rate: f64| {
        [format!("law.factor.error={error:?}"), format!("law.factor.error_rate={error_rate:?}")]
    };
    for (margin, rate_margin, k) in [(1.01, 1.01, 1.0), (0.99, 1.01, 0.0), (1.01, 0.99, 0.0)] {
        let [error, error_rate] = with(norm(e) * margin, norm(rate) * rate_margin);
        assert_regulated(&[kind, &error, &error_rate], |_, _| [k; 2]);
    }
}

#[test]
fn eq_15a_fades_with_the_norms_of_the_errors() {
    let sets = ["law.factor.kind=exponential", "law.factor.error=0.3", "law.factor.error_rate=2.5"];
    assert_regulated(&sets, |e, rate| [(-(norm(e) / 0.3 + norm(rate) / 2.5)).exp(); 2]);
    // The defaults are the paper's 1 m and 10 m/s.
    assert_regulated(&[], |e, rate| [(-(norm(e) + norm(rate) / 10.0)).exp(); 2]);
}

#[test]
fn eq_15b_fades_on_each_axis_alone() {
    let sets = [
        "law.factor.kind=diagonal",
        "law.factor.error=[0.3, 0.7]",
        "law.factor.error_rate=[2.5, 0.9]",
    ];
    assert_regulated(&sets, |e, rate| {
        [
            (-(e[0].abs() / 0.3 + rate[0].abs() / 2.5)).exp(),
            (-(e[1].abs() / 0.7 + rate[1].abs() / 0.9)).exp(),
        ]
    });
}

/// ‖E⁻¹ x‖.
fn relative(x: Plane, thresholds: Plane) -> f64 {
    norm([x[0] / thresholds[0], x[1] / thresholds[1]])
}

#[test]
fn thresholds_of_eq_15a_may_differ_between_the_axes() {
    let sets = [
        "law.factor.kind=exponential",
        "law.factor.error=[0.3, 0.7]",
        "law.factor.error_rate=[2.5, 0.9]",
    ];
    let k = |e, rate| (-(relative(e, [0.3, 0.7]) + relative(rate, [2.5, 0.9]))).exp();
    assert_regulated(&sets, |e, rate| [k(e, rate); 2]);
    let under = [&sets[..], &["law.factor.ceiling=0.8"]].concat();
    assert_regulated(&under, |e, rate| [0.8 * k(e, rate); 2]);
    // One of the two may be a number for all axes.
    let sets = ["law.factor.error=[0.3, 0.7]", "law.factor.error_rate=2.5"];
    assert_regulated(&sets, |e, rate| [(-(relative(e, [0.3, 0.7]) + norm(rate) / 2.5)).exp(); 2]);
}

#[test]
fn thresholds_of_eq_14_may_differ_between_the_axes() {
    let (_, _, _, e, rate) = second_answer(&[]);
    // ‖E⁻¹ e‖ and ‖Ė⁻¹ ė‖ are one over the margin.
    let around = |x: Plane, margin: f64| {
        let scale = margin * relative(x, [0.5, 2.0]);
        format!("[{:?}, {:?}]", 0.5 * scale, 2.0 * scale)
    };
    for (margin, rate_margin, k) in [(1.01, 1.01, 1.0), (0.99, 1.01, 0.0), (1.01, 0.99, 0.0)] {
        let sets = [
            "law.factor.kind=switch",
            &format!("law.factor.error={}", around(e, margin)),
            &format!("law.factor.error_rate={}", around(rate, rate_margin)),
        ];
        assert_regulated(&sets, |_, _| [k; 2]);
        let under = [&sets[..], &["law.factor.ceiling=0.8"]].concat();
        assert_regulated(&under, |_, _| [0.8 * k; 2]);
    }
}

#[test]
fn equal_thresholds_are_one_threshold_bit_for_bit() {
    for kind in ["switch", "exponential", "diagonal"] {
        let answers = [("0.3", "2.7"), ("[0.3, 0.3]", "[2.7, 2.7]")].map(|(error, error_rate)| {
            let sets = [
                &format!("law.factor.kind={kind}"),
                &format!("law.factor.error={error}"),
                &format!("law.factor.error_rate={error_rate}"),
            ];
            let mut controller = controller(&sets.map(String::as_str));
            (0..20).map(|k| *controller.respond(&swinging(10 * k)).unwrap()).collect::<Vec<_>>()
        });
        assert_eq!(answers[0], answers[1], "{kind}");
    }
}

#[test]
fn a_constant_factor_is_its_ceiling_whatever_the_error() {
    let kind = "law.factor.kind=constant";
    assert_regulated(&[kind], |_, _| [1.0; 2]);
    assert_regulated(&[kind, "law.factor.ceiling=0.6", "law.factor.error=1e-6"], |_, _| [0.6; 2]);
}

#[test]
fn eq_11_adds_the_error_of_the_acceleration() {
    let (with, without) = (["law.acceleration=true"], ["law.acceleration=false"]);
    let (mut with, mut without) = (controller(&with), controller(&without));
    let speed = |state: &StateSample| {
        let (q, v) = joints(state);
        times(jacobian(q), v)
    };
    // No difference can be taken at the first sample: the tip counts as not accelerating.
    let first = *with.respond(&swinging(0)).unwrap();
    let plain = without.respond(&swinging(0)).unwrap();
    let [_, _, wanted] = desired(0.0);
    assert_close(&first.echo, mix(1.0, [plain.echo[0], plain.echo[1]], 1.0, wanted), "at first");
    let second = with.respond(&swinging(10)).unwrap();
    let [_, _, wanted] = desired(0.01);
    let found = mix(100.0, speed(&swinging(10)), -100.0, speed(&swinging(0)));
    let (e, rate) = tracking_error(&swinging(10));
    let k = (-(norm(e) + norm(rate) / 10.0)).exp();
    let tj = mix(30.0, e, 60.0, rate);
    let memory = mix(k, [first.echo[0], first.echo[1]], 1.0, mix(1.0, wanted, -1.0, found));
    let expected = mix(1.0, tj, 1.0, memory);
    for (found, expected) in second.echo.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{found} is not {expected}");
    }
}

#[test]
fn mb_makes_the_tip_accelerate_as_its_gains_ask() {
    for state in states() {
        let mut controller = controller(&["law.kind=mb", "law.kp=8", "law.kd=4"]);
        let answer = controller.respond(&state).unwrap();
        let (q, v) = joints(&state);
        let joint = acceleration(q, v, [answer.torque[0], answer.torque[1]]);
        let found = mix(1.0, times(jacobian(q), joint), 1.0, bend(q, v));
        let (e, rate) = tracking_error(&state);
        let [_, _, wanted] = desired(state.header.time_ns as f64 * 1e-9);
        let expected = mix(1.0, mix(8.0, e, 4.0, rate), 1.0, wanted);
        assert!(norm(mix(1.0, found, -1.0, expected)) < 1e-9, "{found:?} is not {expected:?}");
        assert_eq!(text_of(&controller.error().law), "mb");
    }
}

#[test]
fn a_model_that_is_ten_percent_too_heavy_asks_for_ten_percent_more() {
    for state in states() {
        let respond = |scale: &str| {
            let scale = format!("law.model.mass_scale={scale}");
            *controller(&["law.kind=mb", &scale]).respond(&state).unwrap()
        };
        let (exact, heavy) = (respond("1.0"), respond("1.1"));
        assert_close(&heavy.echo, mix(1.1, [exact.echo[0], exact.echo[1]], 0.0, [0.0; 2]), "Q̂");
        assert_close(
            &heavy.torque,
            mix(1.1, [exact.torque[0], exact.torque[1]], 0.0, [0.0; 2]),
            "τ",
        );
    }
}

#[test]
fn gravity_of_the_model_is_added_to_the_torque_and_stays_out_of_the_echo() {
    let gravity = "arm.gravity=[0.0, -9.81]";
    for state in states() {
        let [q1, q2] = [state.position[0], state.position[1]];
        let forearm = 9.81 * 3.0 * 0.5 * (q1 + q2).cos();
        let by_hand = [9.81 * (4.0 * 0.5 + 3.0) * q1.cos() + forearm, forearm];
        for law in [&["law.kind=tj"][..], &["law.kind=mtj"], &["law.kind=tdc", "law.mass=1.5"]] {
            let answer = |more: &[&str]| {
                *controller(&[law, &[gravity], more].concat()).respond(&state).unwrap()
            };
            let (without, with) = (answer(&[]), answer(&["law.gravity=model"]));
            assert_eq!(with.echo, without.echo, "{law:?}");
            let heavy = answer(&["law.gravity=model", "law.model.mass_scale=1.5"]);
            for joint in 0..2 {
                let added = with.torque[joint] - without.torque[joint];
                assert!((added - by_hand[joint]).abs() < 1e-9, "{law:?}: {added} {by_hand:?}");
                let added = heavy.torque[joint] - without.torque[joint];
                assert!((added - 1.5 * by_hand[joint]).abs() < 1e-9, "of the model: {added}");
            }
        }
        let of_mb = |more: &[&str]| {
            *controller(&[&["law.kind=mb", gravity], more].concat()).respond(&state).unwrap()
        };
        assert_eq!(of_mb(&["law.gravity=model"]), of_mb(&[]), "mb has it in its equation");
    }
}

#[test]
fn mb_near_a_singular_posture_damps_its_inverse_and_shows_that() {
    let mut inverting = controller(&["law.kind=mb"]);
    let mut before: Option<[f64; 2]> = None;
    // The elbow passes through a stretched arm, a milliradian at a time.
    for step in -300..=300 {
        let fold = f64::from(step) * 1e-3;
        let answer = inverting.respond(&state(2500, [0.3, fold], [0.0, 0.0])).unwrap();
        let torque = [answer.torque[0], answer.torque[1]];
        if let Some(before) = before {
            let jump =
                (0..2).map(|joint| (torque[joint] - before[joint]).abs()).fold(0.0, f64::max);
            assert!(jump < 80.0, "q₂ = {fold}: {before:?} N m, then {torque:?}");
        }
        assert!(torque[0].abs() < 3000.0, "q₂ = {fold}: {torque:?} N m");
        before = Some(torque);
        let damping = inverting.error().signal("damping").unwrap()[0];
        assert_eq!(damping > 0.0, inverting.is_damped());
        assert_eq!(damping > 0.0, fold.abs() < 0.1, "q₂ = {fold}: {damping}");
    }
    for kind in ["law.kind=tj", "law.kind=mtj"] {
        let answer = *controller(&[kind]).respond(&state(2500, [0.3, 0.0], [1.0, 1.0])).unwrap();
        assert!(answer.torque.iter().all(|torque| torque.is_finite()), "{kind} needs no inverse");
    }
}

#[test]
fn mb_on_a_redundant_arm_is_refused_with_the_scenario() {
    let set: Override = "law.kind=mb".parse().unwrap();
    let refused = Scenario::parse("redundant/mtj", built_in("redundant/mtj").unwrap(), &[set]);
    let sentence = refused.unwrap_err().to_string();
    for word in ["law.kind", "mb", "tj or mtj", "3 joints", "2 task axes"] {
        assert!(sentence.contains(word), "'{word}' in: {sentence}");
    }
}

#[test]
fn a_redundant_arm_takes_the_transpose_of_its_jacobian() {
    let lengths = [0.8, 0.7, 0.5];
    let (q, v) = ([0.1, 0.9, 0.7], [0.5, -0.4, 1.1]);
    let asked = state(0, q, v);
    let angle = [q[0], q[0] + q[1], q[0] + q[1] + q[2]];
    // What link i contributes to the tip, and so column j is the sum over the links from j outward.
    let part = |i: usize| [lengths[i] * f64::cos(angle[i]), lengths[i] * f64::sin(angle[i])];
    let lever = |j: usize| (j..3).map(part).fold([0.0; 2], |sum, x| mix(1.0, sum, 1.0, x));
    let column = |j: usize| [-lever(j)[1], lever(j)[0]];
    let speed = (0..3).fold([0.0; 2], |sum, j| mix(1.0, sum, v[j], column(j)));
    // A circle about (0.8, 1.0) of radius 0.3, from its rightmost point.
    let e = mix(1.0, [1.1, 1.0], -1.0, lever(0));
    let rate = mix(1.0, [0.0, 0.3], -1.0, speed);
    let force = mix(30.0, e, 60.0, rate);
    for kind in ["law.kind=tj", "law.kind=mtj"] {
        let answer = *Controller::new(&scenario("redundant/mtj", &[kind])).respond(&asked).unwrap();
        assert_close(&answer.echo, force, kind);
        for (j, found) in answer.torque[..3].iter().enumerate() {
            let expected = column(j)[0] * force[0] + column(j)[1] * force[1];
            assert!((found - expected).abs() < 1e-10, "{kind}, joint {j}: {found} not {expected}");
        }
    }
}

#[test]
fn a_state_of_another_arm_is_an_error() {
    let mut asked = states()[0];
    asked.header.joints = 3;
    let found = controller(&[]).respond(&asked).copied();
    assert_eq!(found, Err(LawError::Joints { expected: 2, found: 3 }));
}
