//! The zero-order hold: what it holds, what it says it has delivered, and what it does when told
//! too much.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_plant::actuator::{Actuator, Command};
use mtj_protocol::sample::padded;

const MS: u64 = 1_000_000;
/// Joint velocities, rad/s.
const REST: [f64; 7] = [0.0; 7];
/// An instant at which nothing happens any more, ns.
const LATER: u64 = 10_000_000_000;

fn actuator(sets: &[&str]) -> Actuator {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Actuator::new(&Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap())
}

fn command(sequence: u64, torque: [f64; 2], force: [f64; 2]) -> Command {
    Command {
        sequence,
        sampled_ns: sequence * 10 * MS,
        torque: padded(&torque),
        gravity: [0.0; 7],
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
        assert!(actuator.apply(&command(sequence, torque, [8.0, -6.0]), sequence * 10 * MS, &REST));
        let held = actuator.torque(LATER, &[0.0; 7]);
        assert_eq!(held[..2], [torque[0] * scale, torque[1] * scale], "{torque:?}");
        assert_eq!(actuator.applied(LATER)[..2], [8.0 * scale, -6.0 * scale], "{torque:?}");
    }
}

#[test]
fn a_torque_limit_scales_what_is_left_beside_gravity_as_long_as_gravity_fits_under_it() {
    let mut actuator = actuator(&["safety.torque_limit=[10.0, 5.0]"]);
    let carrying = |sequence, torque, gravity: [f64; 2]| Command {
        gravity: padded(&gravity),
        ..command(sequence, torque, [8.0, -6.0])
    };
    for (sequence, torque, gravity, held, scale) in [
        (0, [14.0, 1.0], [6.0, -1.0], [10.0, 0.0], 0.5),
        (1, [-22.0, 1.0], [6.0, 1.0], [-10.0, 1.0], 16.0 / 28.0),
        (2, [9.0, 4.0], [6.0, 1.0], [9.0, 4.0], 1.0),
        // Too heavy: the whole is scaled.
        (3, [20.0, 2.0], [12.0, 1.0], [10.0, 1.0], 0.5),
    ] {
        actuator.apply(&carrying(sequence, torque, gravity), sequence * 10 * MS, &REST);
        let found = actuator.torque(LATER, &REST);
        assert!(
            (found[0] - held[0]).abs() < 1e-12 && (found[1] - held[1]).abs() < 1e-12,
            "{found:?}"
        );
        assert!(
            (actuator.applied(LATER)[0] - 8.0 * scale).abs() < 1e-12,
            "{:?}",
            actuator.applied(LATER)
        );
    }
}

#[test]
fn a_rate_limit_takes_all_joints_and_the_echo_the_same_part_of_the_way() {
    // 100 and 300 N m/s at a sample period of 10 ms.
    let mut actuator = actuator(&["safety.torque_rate_limit=[100.0, 300.0]"]);
    for sequence in 0..5 {
        // 1 N m or 3 N m a command: the second joint sets the pace.
        actuator.apply(&command(sequence, [2.0, 12.0], [8.0, -4.0]), sequence * 10 * MS, &REST);
        let (held, applied) = (actuator.torque(LATER, &REST), actuator.applied(LATER));
        let (way, most) = (held[1] / 12.0, 3.0 * (sequence + 1) as f64 / 12.0);
        assert!((way - most.min(1.0)).abs() < 1e-12, "{held:?}");
        assert!((held[0] - 2.0 * way).abs() < 1e-12 && (applied[0] - 8.0 * way).abs() < 1e-12);
    }
}

#[test]
fn commands_that_come_together_do_not_change_the_torque_faster_than_its_rate() {
    // 100 N m/s: 1 N m in a sample period of 10 ms. Late commands come all at once.
    let mut actuator = actuator(&["safety.torque_rate_limit=100.0"]);
    let mut held = |sequence, at_ms: u64| {
        actuator.apply(&command(sequence, [20.0, 0.0], [8.0, 0.0]), at_ms * MS, &REST);
        actuator.torque(LATER, &REST)[0]
    };
    for (sequence, at_ms, expected) in
        [(0, 0, 1.0), (1, 40, 2.0), (2, 41, 2.1), (3, 41, 2.1), (4, 43, 2.3), (5, 53, 3.3)]
    {
        assert!((held(sequence, at_ms) - expected).abs() < 1e-12, "command {sequence}");
    }
}

#[test]
fn a_command_after_a_timeout_begins_at_what_acts_then() {
    let mut actuator = actuator(&[
        "safety.torque_rate_limit=100.0",
        "safety.command_timeout=50ms",
        "safety.on_timeout=damp",
        "safety.damping=2.0",
    ]);
    actuator.apply(&command(0, [0.5, -0.5], [8.0, 4.0]), 0, &REST);
    actuator.time_out(50 * MS, &REST);
    let speed: [f64; 7] = padded(&[1.5, 0.0]);
    assert_eq!(actuator.torque(LATER, &speed)[..2], [-3.0, 0.0]);
    actuator.apply(&command(9, [5.0, 0.0], [8.0, 4.0]), 90 * MS, &speed);
    let held = actuator.torque(LATER, &REST);
    assert!((held[0] + 2.0).abs() < 1e-12, "one N m on from −3: {held:?}");
    assert!((actuator.applied(LATER)[0] - 1.0).abs() < 1e-12, "an eighth of the way from no echo");
}

#[test]
fn limits_and_reactions_that_change_act_on_what_is_held() {
    let scenario = |sets: &[&str]| {
        let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
        Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap()
    };
    let hold = "safety.on_timeout=hold";
    let mut actuator = actuator(&[hold]);
    actuator.apply(&command(0, [8.0, -2.0], [4.0, 2.0]), 0, &REST);
    actuator.reconfigure(&scenario(&[hold, "safety.torque_limit=[2.0, 2.0]"]), MS, &REST);
    assert_eq!(actuator.torque(LATER, &REST)[..2], [2.0, -0.5]);
    assert_eq!(actuator.applied(LATER)[..2], [1.0, 0.5]);
    actuator.time_out(2 * MS, &REST);
    assert_eq!(actuator.torque(LATER, &REST)[..2], [2.0, -0.5], "held");
    let moving: [f64; 7] = padded(&[0.5, -0.25]);
    let damp = ["safety.on_timeout=damp", "safety.damping=4.0"];
    actuator.reconfigure(&scenario(&damp), 3 * MS, &moving);
    assert_eq!(actuator.torque(LATER, &moving)[..2], [-2.0, 1.0]);
    assert_eq!(actuator.applied(LATER), [0.0; 7]);
    actuator.reconfigure(&scenario(&[hold]), 4 * MS, &moving);
    assert_eq!(actuator.torque(LATER, &REST)[..2], [-2.0, 1.0], "what the brake exerted is held");
    actuator.reconfigure(&scenario(&["safety.on_timeout=zero"]), 5 * MS, &moving);
    assert_eq!(actuator.torque(LATER, &moving), [0.0; 7]);
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
            actuator.apply(
                &command(sequence as u64, [0.0; 2], [*force, -2.0 * force]),
                at * MS,
                &REST,
            );
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
    actuator.apply(&command(0, [1.0, 1.0], [3.0, 4.0]), 0, &REST);
    for sample in 1..2000 {
        let delivered = actuator.delivered(sample * 10 * MS, 10 * MS);
        assert!((delivered[0] - 3.0).abs() < 1e-9 && (delivered[1] - 4.0).abs() < 1e-9);
    }
}

#[test]
fn an_older_command_never_replaces_a_newer_one() {
    let mut actuator = actuator(&[]);
    assert_eq!(actuator.latency_ns(), 0, "before any command");
    assert!(actuator.apply(&command(5, [1.0, 2.0], [3.0, 4.0]), 57 * MS, &REST));
    assert!(!actuator.apply(&command(4, [9.0, 9.0], [9.0, 9.0]), 58 * MS, &REST));
    assert!(!actuator.apply(&command(5, [9.0, 9.0], [9.0, 9.0]), 59 * MS, &REST));
    assert_eq!(actuator.torque(LATER, &[0.0; 7])[..2], [1.0, 2.0]);
    assert_eq!(actuator.applied(LATER)[..2], [3.0, 4.0]);
    assert_eq!(actuator.latency_ns(), 7 * MS, "from 50 ms to 57 ms");
}

#[test]
fn after_a_timeout_no_task_force_counts_as_delivered() {
    let mut actuator = actuator(&["safety.on_timeout=zero"]);
    actuator.delivered(0, 10 * MS);
    actuator.apply(&command(0, [1.0, 1.0], [10.0, 20.0]), 0, &REST);
    actuator.time_out(4 * MS, &REST);
    assert_eq!(actuator.torque(LATER, &[1.0; 7]), [0.0; 7]);
    assert_eq!(actuator.applied(LATER), [0.0; 7]);
    let delivered = actuator.delivered(10 * MS, 10 * MS);
    assert!((delivered[0] - 4.0).abs() < 1e-12 && (delivered[1] - 8.0).abs() < 1e-12);
}

#[test]
fn delivered_stays_right_when_the_sample_period_changes() {
    // A force of 6 N from the start; samples every 10 ms, then every 4 ms, then every 25 ms.
    let mut actuator = actuator(&["law.memory.policy=delivered"]);
    actuator.apply(&command(0, [0.0; 2], [6.0, -3.0]), 0, &REST);
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
