//! Whole runs of the plant against controllers that are a function here.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::convert::Infallible;

use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_plant::{
    direct::Direct,
    plant::{self, Outcome, Watch},
    trace::TraceRow,
};
use mtj_protocol::sample::{StateSample, TorqueSample, padded};

fn run(sets: &[&str], mut respond: impl FnMut(&StateSample) -> TorqueSample) -> Outcome {
    let fixed = ["timing.clock=lockstep", "bus.kind=local", "duration=1s"];
    let sets: Vec<Override> = fixed.iter().chain(sets).map(|set| set.parse().unwrap()).collect();
    let scenario = Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap();
    let mut exchange = Direct::new(7, |state: &StateSample| Ok::<_, Infallible>(respond(state)));
    let watch = Watch { trace: true, ..Watch::default() };
    plant::run(&scenario, 7, &mut exchange, watch, &|| true).unwrap()
}

fn answer(state: &StateSample, torque: [f64; 2], force: [f64; 2]) -> TorqueSample {
    TorqueSample {
        header: state.header.answer(),
        torque: padded(&torque),
        echo: padded(&force),
        echo_count: 2,
        ..Default::default()
    }
}

/// Springs and dampers at the joints, about a posture that moves with the sample's time stamp.
fn springs(state: &StateSample) -> TorqueSample {
    let time = state.header.time_ns as f64 * 1e-9;
    let torque = std::array::from_fn(|i| {
        let desired = 0.3 * (2.0 * time + i as f64).sin() + i as f64;
        15.0 * (desired - state.position[i]) - 4.0 * state.velocity[i] + 0.1 * state.applied[i]
            - 0.05 * state.delivered[i]
    });
    answer(state, torque, [torque[0] + torque[1], torque[1]])
}

/// Answers with a held torque up to the sample at 0.1 s, and with a number that is none from then
/// on.
fn falls_silent(state: &StateSample) -> TorqueSample {
    let torque = if state.header.sequence <= 10 { [1.0, 0.5] } else { [f64::NAN, 0.5] };
    answer(state, torque, [2.0, -3.0])
}

fn after(outcome: &Outcome, time: f64) -> impl Iterator<Item = &TraceRow> {
    outcome.trace.iter().filter(move |row| row.time > time)
}

#[test]
fn a_torque_that_is_not_finite_never_reaches_the_arm() {
    let outcome = run(&[], falls_silent);
    assert_eq!(outcome.trace.len(), 100);
    for row in &outcome.trace {
        let numbers = row.position.iter().chain(&row.velocity).chain(&row.torque).chain(&row.echo);
        assert!(numbers.copied().all(f64::is_finite), "{row:?}");
    }
    let commands = outcome.report.commands;
    assert_eq!((commands.sent, commands.applied, commands.rejected), (100, 11, 89));
    assert!(!outcome.report.diverged);
}

#[test]
fn without_a_command_timeout_the_last_torque_is_held_for_ever() {
    for row in after(&run(&[], falls_silent), 0.0) {
        assert_eq!((&row.torque[..2], &row.echo[..2]), (&[1.0, 0.5][..], &[2.0, -3.0][..]));
    }
}

#[test]
fn on_timeout_hold_keeps_the_torque() {
    let outcome = run(&["safety.command_timeout=25ms", "safety.on_timeout=hold"], falls_silent);
    assert!(after(&outcome, 0.0).all(|row| row.torque[..2] == [1.0, 0.5]));
}

#[test]
fn on_timeout_zero_gives_no_torque_once_the_timeout_is_over() {
    let outcome = run(&["safety.command_timeout=25ms", "safety.on_timeout=zero"], falls_silent);
    for row in after(&outcome, 0.0) {
        // The last command came at 0.100 s.
        let expected = if row.time < 0.1251 { [1.0, 0.5] } else { [0.0, 0.0] };
        assert_eq!(row.torque[..2], expected, "at {} s", row.time);
    }
}

#[test]
fn on_timeout_damp_brakes_the_joints() {
    let sets = ["safety.command_timeout=25ms", "safety.on_timeout=damp", "safety.damping=40.0"];
    let outcome = run(&sets, falls_silent);
    for row in after(&outcome, 0.1251) {
        for joint in 0..2 {
            assert_eq!(row.torque[joint], -40.0 * row.velocity[joint], "at {} s", row.time);
        }
        assert_eq!(row.echo[..2], [0.0, 0.0]);
    }
    let speed = |row: &TraceRow| row.velocity[0].hypot(row.velocity[1]);
    let (first, last) = (&outcome.trace[13], &outcome.trace[99]);
    assert!(speed(last) < 0.1 * speed(first), "{} to {}", speed(first), speed(last));
}

#[test]
fn a_fresh_command_ends_a_timeout() {
    let pauses = |state: &StateSample| {
        let silent = (11..=50).contains(&state.header.sequence);
        answer(state, if silent { [f64::NAN; 2] } else { [1.0, 0.5] }, [0.0; 2])
    };
    let outcome = run(&["safety.command_timeout=25ms", "safety.on_timeout=zero"], pauses);
    for row in after(&outcome, 0.0) {
        let let_go = row.time > 0.1251 && row.time < 0.5101;
        assert_eq!(row.torque[0], if let_go { 0.0 } else { 1.0 }, "at {} s", row.time);
    }
}

#[test]
fn only_the_sum_of_the_two_latencies_matters() {
    for splits in [
        [(7.0, 0.0), (0.0, 7.0), (3.0, 4.0)],
        [(10.0, 0.0), (0.0, 10.0), (5.0, 5.0)],
        [(25.0, 0.0), (0.0, 25.0), (12.5, 12.5)],
        [(30.0, 0.0), (0.0, 30.0), (10.0, 20.0)],
    ] {
        let traces = splits.map(|(there, back)| {
            let there = format!("link.state.latency={there}ms");
            let back = format!("link.torque.latency={back}ms");
            run(&[&there, &back], springs).trace
        });
        assert!(traces[0] == traces[1], "all there or all back, {splits:?}");
        assert!(traces[0] == traces[2], "half and half, {splits:?}");
        let prompt = run(&[], springs).trace;
        assert!(traces[0] != prompt, "a latency changes the motion, {splits:?}");
    }
}

#[test]
fn a_command_takes_effect_its_latency_after_the_sample() {
    let outcome = run(&["link.state.latency=4ms", "link.torque.latency=9ms"], |state| {
        answer(state, [state.header.sequence as f64 + 1.0, 0.0], [state.latency_ns as f64, 0.0])
    });
    for (k, row) in outcome.trace.iter().enumerate() {
        // 13 ms later: what sample k − 2 gave rise to is in effect at sample k.
        assert_eq!(row.torque[0], (k as f64 - 1.0).max(0.0), "sample {k}");
        let echoed = if k < 4 { 0.0 } else { 13e6 };
        assert_eq!(row.echo[0], echoed, "sample {k} echoes the latency of the command before");
    }
}

#[test]
fn the_same_seed_gives_the_same_noise() {
    let noisy = ["sensor.noise=0.02", "seed=5"];
    let first = run(&noisy, springs).trace;
    assert!(first == run(&noisy, springs).trace);
    assert!(first != run(&["sensor.noise=0.02", "seed=6"], springs).trace);
    assert!(first != run(&[], springs).trace);
}

#[test]
fn a_run_ends_where_it_diverges() {
    let outcome = run(&["duration=20s"], |state| answer(state, [1e6, -1e6], [0.0; 2]));
    assert!(outcome.report.diverged);
    assert!(outcome.report.duration_s < 1.0, "{} s", outcome.report.duration_s);
    assert_eq!(outcome.report.rms_error_m, None, "the second half was never reached");
}

#[test]
fn a_torque_limit_scales_what_the_controller_adds_to_gravity() {
    // Answers with the model's gravity, worked out here, and 30 N m more on the first joint.
    let carrying = |state: &StateSample| {
        let [q1, q2] = [state.position[0], state.position[1]];
        let forearm = 9.81 * 3.0 * 0.5 * (q1 + q2).cos();
        let gravity = [9.81 * (4.0 * 0.5 + 3.0) * q1.cos() + forearm, forearm];
        answer(state, [gravity[0] + 30.0, gravity[1]], [6.0, -3.0])
    };
    let outcome = run(
        &[
            "arm.gravity=[0.0, -9.81]",
            "arm.velocity=[0.0, 0.0]",
            "law.gravity=model",
            "safety.torque_limit=[60.0, 60.0]",
        ],
        carrying,
    );
    let [first, second] = [&outcome.trace[1], &outcome.trace[2]];
    // What was held from the first sample on: q = (0.03, π/2).
    let held = 9.81 * 5.0 * 0.03_f64.cos() - 9.81 * 1.5 * 0.03_f64.sin();
    let part = (60.0 - held) / 30.0;
    assert!(part > 0.3 && part < 0.5, "{part}");
    assert!((first.torque[0] - 60.0).abs() < 1e-9, "{:?}", first.torque);
    assert!((first.torque[1] + 9.81 * 1.5 * 0.03_f64.sin()).abs() < 1e-9, "carried as a whole");
    assert!((first.echo[0] - 6.0 * part).abs() < 1e-9, "{:?}", first.echo);
    assert!(second.torque[0] <= 60.0);
}
