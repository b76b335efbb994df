//! Joint PID against the arm by hand, a table of another implementation, and time-delay control.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

mod by_hand;

use by_hand::{Plane, assert_tabled, desired, jacobian, joints, mix, norm, scenario, solve, state};
use mtj_controller::{
    Controller,
    responder::{Context, Measured, Responder},
};
use mtj_model::{
    MAX_JOINTS, MAX_SIGNALS, MAX_STATE,
    arm::point_mass::PointMass,
    gains::{Gains, JointGains},
    law::{Equation, factor::Factor, mass::Mass, pid::JointPid, tdc::TimeDelay},
    matrix::padded,
    task::Previous,
    trajectory::{Path, PointToPoint},
};
use nalgebra::{SVector, Vector2};

const LAW: &str = "law={kind='pid', kp=[100, 80], kd=40, ki=[90, 110]}";

/// The angles that bring the tip to a point, with the elbow bent as in the paper.
fn bent([x, y]: Plane) -> Plane {
    let elbow = ((x * x + y * y - 2.0) / 2.0).acos();
    [y.atan2(x) - elbow / 2.0, elbow]
}

#[test]
fn each_joint_follows_the_inverse_kinematics_of_the_desired_motion() {
    let mut controller = Controller::new(&scenario("sampled/mb", &[LAW]));
    let mut integral = [0.0; 2];
    let instants = [0_u64, 10, 20, 40, 50, 60, 70];
    for (i, time_ms) in instants.into_iter().enumerate() {
        let t = time_ms as f64 * 1e-3;
        let wanted = bent(desired(t)[0]);
        let off = [1e-4 + 0.3 * t, -0.5 * t];
        let state = state(time_ms, mix(1.0, wanted, 1.0, off), [1.2 - t, 0.4 + 2.0 * t]);
        let answer = *controller.respond(&state).unwrap();
        let interval = if i == 0 { 0.0 } else { (time_ms - instants[i - 1]) as f64 * 1e-3 };
        let (q, v) = joints(&state);
        let error = mix(1.0, wanted, -1.0, q);
        let rate = mix(1.0, solve(jacobian(wanted), desired(t)[1]), -1.0, v);
        integral = mix(1.0, integral, interval, error);
        let torque = std::array::from_fn(|j| {
            [100.0, 80.0][j] * error[j] + 40.0 * rate[j] + [90.0, 110.0][j] * integral[j]
        });
        // Two steps of Newton's method leave 1e-7 rad.
        let off = mix(1.0, [answer.torque[0], answer.torque[1]], -1.0, torque);
        assert!(norm(off) < 1e-4, "{time_ms} ms: {:?} is not {torque:?}", answer.torque);
        assert_eq!((answer.echo, answer.echo_count), (answer.torque, 2), "the echo is τ");
        let shown = controller.error().signal("desired_position").unwrap();
        assert!(norm(mix(1.0, [shown[0], shown[1]], -1.0, wanted)) < 1e-6, "q_d, {time_ms} ms");
    }
}

#[test]
fn after_an_outage_the_integral_and_the_references_begin_anew() {
    let mut controller = Controller::new(&scenario("sampled/mb", &[LAW]));
    let [first, second] = [(0, [0.1, 1.4]), (10, [0.2, 1.5])].map(|(t, q)| state(t, q, [1.0; 2]));
    controller.respond(&first).unwrap();
    let mut late = second;
    late.timed_out = 1;
    let answer = *controller.respond(&late).unwrap();
    let mut fresh = Controller::new(&scenario("sampled/mb", &[LAW]));
    assert_eq!(answer, *fresh.respond(&late).unwrap());
}

#[test]
fn the_errors_on_the_papers_arm_are_those_of_another_implementation() {
    let law = "law={kind='pid', kp=100, kd=40, ki=100}";
    assert_tabled(&[law], &[(0, 62.7), (5, 63.8), (10, 65.0), (20, 67.5)], 2e-3);
}

/// What a law on a mass answers to positions at equal times, each with the velocity that is its
/// difference from the one before.
fn answers<L: Equation<f64, 2>>(
    law: L,
    positions: &[Vector2<f64>],
    period: f64,
) -> Vec<Vector2<f64>> {
    let rest = Path::PointToPoint(PointToPoint {
        from: Vector2::zeros(),
        to: Vector2::zeros(),
        duration: 1.0,
    });
    let responder = Responder { arm: PointMass { mass: 1.7 }, trajectory: rest.into(), law };
    let (mut kept, mut unseen) = ([0.0; MAX_STATE], [0.0; MAX_SIGNALS]);
    let (mut previous, mut echo) = (Previous::none(), None);
    let mut answers = Vec::new();
    for (k, pair) in positions.windows(2).enumerate() {
        let (time, velocity) = (k as f64 * period, (pair[1] - pair[0]) / period);
        let at = [pair[1], velocity];
        let measured =
            Measured { time, position: &pair[1], velocity: &velocity, at: &at, ahead: None };
        let context = Context { previous, horizon: None, echo: echo.as_ref(), precomputed: None };
        let torque = responder.respond(&measured, &context, &mut kept, &mut unseen).command.torque;
        (previous, echo) = (Previous { time, velocity }, Some(padded(torque.as_slice())));
        answers.push(torque);
    }
    answers
}

#[test]
fn on_a_mass_it_is_time_delay_control_whose_rates_are_differences() {
    let (period, mass, kp, kd) = (0.01, 1.3, 20.0, 9.0);
    let same = |gain: f64| JointGains { each: [gain; MAX_JOINTS] };
    let gains = |gain: f64| Gains::<f64, 2>::Diagonal(SVector::repeat(gain));
    let pid = JointPid::<f64, 2> {
        kp: same(mass * kd / period),
        kd: same(mass / period),
        ki: same(mass * kp / period),
    };
    let tdc = TimeDelay::<f64, 2> {
        kp: gains(kp),
        kd: gains(kd),
        mass: Mass::Constant(gains(mass)),
        factor: Factor::constant(1.0),
    };
    let wave = |k: usize| {
        let t = k as f64 * period;
        Vector2::new(0.1 * (3.0 * t).sin() + 0.02 * t * t, 0.2 - 0.1 * (7.0 * t).cos())
    };
    let positions: Vec<_> = (0..300).map(wave).collect();
    let [pid, tdc] = [answers(pid, &positions, period), answers(tdc, &positions, period)];
    // They differ by what they begin with, and by nothing else.
    let begin = pid[0] - tdc[0];
    for (k, (pid, tdc)) in pid.iter().zip(&tdc).enumerate() {
        assert!((pid - tdc - begin).norm() < 1e-8, "{k}: {pid} and {tdc}, from {begin}");
    }
    assert!((tdc[299 - 1] - tdc[0]).norm() > 1.0, "and they do change");
}
