//! The zero-order hold: what it holds, what it says it has delivered, and what it does when told
//! too much.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_plant::actuator::{Actuator, Command};
use mtj_protocol::sample::padded;

const MS: u64 = 1_000_000;

fn actuator(sets: &[&str]) -> Actuator {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Actuator::new(&Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap())
}

fn command(sequence: u64, torque: [f64; 2], force: [f64; 2]) -> Command {
    Command {
        sequence,
        sampled_ns: sequence * 10 * MS,
        torque: padded(&torque),
        echo: padded(&force),
        echo_count: 2,
    }
}

#[test]
fn a_torque_limit_scales_all_torques_and_the_task_force_together() {
    let mut actuator = actuator(&["safety.torque_limit=[10.0, 5.0]"]);
    for (sequence, torque, scale) in [
        (0, [20.0, 4.0], 0.5),
        (1, [2.0, -20.0], 0.25),
        (2, [-40.0, 40.0], 0.125),
        (3, [10.0, -5.0], 1.0),
        (4, [0.0, 0.0], 1.0),
    ] {
        assert!(actuator.apply(&command(sequence, torque, [8.0, -6.0]), sequence * 10 * MS));
        let held = actuator.torque(&[0.0; 7]);
        assert_eq!(held[..2], [torque[0] * scale, torque[1] * scale], "{torque:?}");
        assert_eq!(actuator.applied()[..2], [8.0 * scale, -6.0 * scale], "{torque:?}");
    }
}

#[test]
fn delivered_is_the_exact_mean_over_the_memory_step() {
    // Commands change in mid-period; the step is three periods of 10 ms.
    let mut actuator = actuator(&["law.memory.policy=delivered", "law.memory.step=30ms"]);
    let changes = [(4, 1.0), (17, 3.0), (25, -2.0), (50, 7.0)];
    let held_at = |ms: u64| changes.iter().rev().find(|(at, _)| *at <= ms).map_or(0.0, |(_, f)| *f);
    let by_hand = [0.0, 6.0, 22.0, 27.0, 1.0, -35.0, 30.0, 120.0];
    let mut next = changes.iter().enumerate().peekable();
    for (sample, expected) in by_hand.into_iter().enumerate() {
        let now = 10 * sample as u64;
        while let Some((sequence, (at, force))) = next.next_if(|(_, (at, _))| *at <= now) {
            actuator.apply(&command(sequence as u64, [0.0; 2], [*force, -2.0 * force]), at * MS);
        }
        let impulse: f64 = (now.saturating_sub(30)..now).map(held_at).sum();
        assert_eq!(impulse, expected, "worked by hand at {now} ms");
        let delivered = actuator.delivered(now * MS, 30 * MS);
        assert!((delivered[0] - expected / 30.0).abs() < 1e-12, "{now} ms: {delivered:?}");
        assert!((delivered[1] + 2.0 * expected / 30.0).abs() < 1e-12, "{now} ms: {delivered:?}");
    }
}

#[test]
fn delivered_over_one_period_is_the_held_force_if_nothing_changes() {
    let mut actuator = actuator(&["law.memory.policy=delivered"]);
    assert_eq!(actuator.delivered(0, 10 * MS), [0.0; 7]);
    actuator.apply(&command(0, [1.0, 1.0], [3.0, 4.0]), 0);
    for sample in 1..2000 {
        let delivered = actuator.delivered(sample * 10 * MS, 10 * MS);
        assert!((delivered[0] - 3.0).abs() < 1e-9 && (delivered[1] - 4.0).abs() < 1e-9);
    }
}

#[test]
fn an_older_command_never_replaces_a_newer_one() {
    let mut actuator = actuator(&[]);
    assert_eq!(actuator.latency_ns(), 0, "before any command");
    assert!(actuator.apply(&command(5, [1.0, 2.0], [3.0, 4.0]), 57 * MS));
    assert!(!actuator.apply(&command(4, [9.0, 9.0], [9.0, 9.0]), 58 * MS));
    assert!(!actuator.apply(&command(5, [9.0, 9.0], [9.0, 9.0]), 59 * MS));
    assert_eq!(actuator.torque(&[0.0; 7])[..2], [1.0, 2.0]);
    assert_eq!(actuator.applied()[..2], [3.0, 4.0]);
    assert_eq!(actuator.latency_ns(), 7 * MS, "from 50 ms to 57 ms");
    assert_eq!(actuator.commands(), 1);
}

#[test]
fn after_a_timeout_no_task_force_counts_as_delivered() {
    let mut actuator = actuator(&["safety.on_timeout=zero"]);
    actuator.delivered(0, 10 * MS);
    actuator.apply(&command(0, [1.0, 1.0], [10.0, 20.0]), 0);
    actuator.time_out(4 * MS);
    assert_eq!(actuator.torque(&[1.0; 7]), [0.0; 7]);
    assert_eq!(actuator.applied(), [0.0; 7]);
    let delivered = actuator.delivered(10 * MS, 10 * MS);
    assert!((delivered[0] - 4.0).abs() < 1e-12 && (delivered[1] - 8.0).abs() < 1e-12);
}

#[test]
fn delivered_stays_right_when_the_sample_period_changes() {
    // A force of 6 N from the start; samples every 10 ms, then every 4 ms, then every 25 ms.
    let mut actuator = actuator(&["law.memory.policy=delivered"]);
    actuator.apply(&command(0, [0.0; 2], [6.0, -3.0]), 0);
    let instants = [0, 10, 20, 24, 28, 32, 57, 82, 107];
    let mut before = 0;
    for now in instants {
        let step = if now == 0 { 10 } else { now - before };
        let delivered = actuator.delivered(now * MS, step * MS);
        let expected = if now == 0 { 0.0 } else { 6.0 };
        assert!((delivered[0] - expected).abs() < 1e-9, "{now} ms: {delivered:?}");
        before = now;
    }
    // A step of 15 ms begins between the instants 82 and 107 ms.
    let delivered = actuator.delivered(112 * MS, 15 * MS);
    assert!((delivered[1] + 3.0).abs() < 1e-9, "{delivered:?}");
}
