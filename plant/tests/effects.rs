//! What makes a plant worth controlling, against closed forms: friction, rotors, loads, lags.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_plant::{
    actuator::{Actuator, Command},
    engine::{Drive, Engine, engine},
};

/// kg m², of the one link about its joint: inertia + mass · center².
const INERTIA: f64 = 0.5 + 2.0 * 0.25;
const SECOND: u64 = 1_000_000_000;

fn scenario(sets: &[&str]) -> Scenario {
    let fixed = [
        "arm={links=[{length=1.0, mass=2.0, inertia=0.5}], position=[0.3], velocity=[2.0]}",
        "trajectory={kind='circle', radius=0.9, angular_frequency=0.1}",
    ];
    let sets: Vec<Override> = fixed.iter().chain(sets).map(|set| set.parse().unwrap()).collect();
    Scenario::parse("here", built_in("sampled/mtj").unwrap(), &sets).unwrap()
}

fn plant(sets: &[&str]) -> Box<dyn Engine> {
    engine(&scenario(sets))
}

fn held(torque: f64) -> Drive {
    let mut all = [0.0; 7];
    all[0] = torque;
    Drive::Torque(all)
}

fn assert_near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found}, expected {expected}");
}

#[test]
fn a_joint_with_viscous_friction_slows_down_exponentially() {
    let mut plant = plant(&["arm.friction.viscous=0.8"]);
    for tenth in 1..30 {
        plant.advance(tenth * SECOND / 10, &held(0.0));
        let expected = 2.0 * (-0.8 / INERTIA * tenth as f64 / 10.0).exp();
        assert_near(plant.state().velocity[0], expected, 1e-9);
    }
}

#[test]
fn a_joint_with_dry_friction_comes_to_rest_as_the_smooth_sign_has_it() {
    // I dω/dt = −F tanh(ω/s), so that sinh(ω/s) shrinks exponentially; it is stiff near rest.
    let (force, smoothing) = (1.5, 0.05);
    let mut plant = plant(&["arm.friction={coulomb=1.5, smoothing=0.05}"]);
    for hundredth in 1..300 {
        let time = hundredth as f64 / 100.0;
        plant.advance(hundredth * SECOND / 100, &held(0.0));
        // asinh(sinh(a) e^−b) = a − b while both are large.
        let (a, b) = (2.0 / smoothing, force * time / (INERTIA * smoothing));
        let expected = if a - b > 20.0 {
            smoothing * (a - b)
        } else {
            smoothing * (0.5 * (a - b).exp()).asinh()
        };
        assert_near(plant.state().velocity[0], expected, 1e-6);
    }
}

#[test]
fn a_joint_at_rest_resists_more_and_breaks_away_beyond_that() {
    let sets = ["arm.friction={coulomb=1.0, stribeck=0.5}", "arm.velocity=[0.0]"];
    let after = |torque: f64| {
        let mut plant = plant(&sets);
        plant.advance(2 * SECOND, &held(torque));
        plant.state().velocity[0]
    };
    // Below coulomb + stribeck it creeps within the smoothing of 0.01 rad/s, beyond it runs away.
    assert!(after(1.4).abs() < 0.03, "{}", after(1.4));
    assert_near(after(3.0), 2.0 * (3.0 - 1.0) / INERTIA, 0.1);
}

#[test]
fn what_friction_takes_is_what_the_motion_loses_and_the_drive_gives() {
    let mut plant = plant(&["arm.friction={coulomb=1.0, viscous=0.3, stribeck=0.4}"]);
    let friction = |rate: f64| {
        (1.0 + 0.4 * (-(rate / 0.1_f64).powi(2)).exp()) * (rate / 0.01).tanh() + 0.3 * rate
    };
    let energy = |rate: f64| 0.5 * INERTIA * rate * rate;
    let (mut lost, mut before) = (0.0, plant.state().velocity[0]);
    let start = energy(before);
    for step in 1..=20_000_u64 {
        plant.advance(step * 100_000, &held(1.8));
        let rate = plant.state().velocity[0];
        lost += 0.5 * (friction(before) * before + friction(rate) * rate) * 1e-4;
        before = rate;
    }
    assert!(before > 0.0, "it turns one way, so that the drive's work is ∫ τ q̇ dt");
    assert_near(start + plant.state().energy, energy(before) + lost, 1e-6);
}

#[test]
fn a_rotor_adds_its_inertia() {
    let mut plant = plant(&["arm.armature=0.25", "arm.velocity=[0.0]"]);
    plant.advance(SECOND, &held(2.0));
    assert_near(plant.state().velocity[0], 2.0 / (INERTIA + 0.25), 1e-12);
}

#[test]
fn a_load_makes_the_arm_heavier_until_it_is_dropped() {
    let mut plant = plant(&["arm.velocity=[0.0]"]);
    let mut expected = 0.0;
    for (second, load) in [(1, 0.0), (2, 1.5), (3, 4.0), (4, 0.0)] {
        plant.carry(load);
        plant.advance(second * SECOND, &held(2.0));
        // A point at the tip, 1 m from the joint.
        expected += 2.0 / (INERTIA + load);
        assert_near(plant.state().velocity[0], expected, 1e-9);
    }
}

fn command(torque: f64, force: f64) -> Command {
    let mut command = Command {
        sequence: 0,
        sampled_ns: 0,
        torque: [0.0; 7],
        gravity: [0.0; 7],
        echo: [0.0; 7],
        echo_count: 2,
    };
    (command.torque[0], command.echo[0]) = (torque, force);
    command
}

#[test]
fn a_lag_is_one_of_first_order_for_arm_and_memory_alike() {
    let sets = ["actuator.time_constant=50ms", "arm.velocity=[0.0]"];
    let (mut plant, mut actuator) = (plant(&sets), Actuator::new(&scenario(&sets)));
    actuator.apply(&command(3.0, 8.0), 0, &[0.0; 7]);
    let (constant, mut before) = (0.05, 0.0);
    for period in 1..40_u64 {
        // T_s = 10 ms.
        let (now_ns, time) = (period * SECOND / 100, period as f64 / 100.0);
        plant.advance(now_ns, actuator.drive());
        let rest = (-time / constant).exp();
        let impulse = time - constant * (1.0 - rest);
        assert_near(plant.state().velocity[0], 3.0 * impulse / INERTIA, 1e-9);
        assert_near(actuator.torque(now_ns, &[0.0; 7])[0], 3.0 * (1.0 - rest), 1e-12);
        assert_near(actuator.applied(now_ns)[0], 8.0 * (1.0 - rest), 1e-12);
        let delivered = actuator.delivered(now_ns, SECOND / 100)[0];
        assert_near(delivered, 8.0 * (impulse - before) / 0.01, 1e-9);
        before = impulse;
    }
}

#[test]
fn a_ramp_is_straight_for_arm_and_memory_alike() {
    let sets = ["actuator.torque_rate_limit=100.0", "arm.velocity=[0.0]"];
    let (mut plant, mut actuator) = (plant(&sets), Actuator::new(&scenario(&sets)));
    actuator.apply(&command(3.0, 6.0), 0, &[0.0; 7]);
    // Half of the way, 15 ms of 30, and then the other way.
    let half = 15_000_000;
    assert_near(actuator.torque(half, &[0.0; 7])[0], 1.5, 1e-12);
    assert_near(actuator.applied(half)[0], 3.0, 1e-12);
    plant.advance(half, actuator.drive());
    let back = Command { sequence: 1, ..command(-0.5, 0.0) };
    actuator.apply(&back, half, &[0.0; 7]);
    assert_near(actuator.torque(half + 10_000_000, &[0.0; 7])[0], 0.5, 1e-12);
    assert_near(actuator.torque(SECOND, &[0.0; 7])[0], -0.5, 1e-12);
    plant.advance(half + 20_000_000, actuator.drive());
    // 15 ms up to 1.5 N m, 20 ms down to −0.5 N m.
    let impulse = 0.015 * 0.75 + 0.02 * 0.5;
    assert_near(plant.state().velocity[0], impulse / INERTIA, 1e-9);
}

#[test]
fn a_torque_is_a_whole_multiple_of_its_resolution_within_its_limit() {
    let sets = ["actuator.resolution=0.4", "safety.torque_limit=3.0"];
    let mut actuator = Actuator::new(&scenario(&sets));
    for (sequence, (asked, exerted)) in
        [(0.5, 0.4), (0.61, 0.8), (-1.3, -1.2), (2.95, 2.8), (9.0, 2.8)].into_iter().enumerate()
    {
        let asking = Command { sequence: sequence as u64, ..command(asked, 0.0) };
        actuator.apply(&asking, 0, &[0.0; 7]);
        assert_near(actuator.torque(0, &[0.0; 7])[0], exerted, 1e-12);
    }
}

#[test]
fn a_tip_comes_back_from_an_elastic_wall_as_fast_as_it_came() {
    // The arm points along x at its start and turns towards y; the wall is met half way up.
    let wall = "wall={point=[0.0, 0.5], normal=[0.0, -1.0], stiffness=1e5}";
    let sets = [wall, "arm.position=[0.2]", "timing.integration_step=10us"];
    let mut plant = plant(&sets);
    let (mut deepest, mut rates) = (0.0_f64, vec![]);
    for millisecond in 1..=1000_u64 {
        plant.advance(millisecond * 1_000_000, &held(0.0));
        deepest = deepest.max(plant.state().position[0].sin() - 0.5);
        rates.push(plant.state().velocity[0]);
    }
    assert_near(rates[0], 2.0, 1e-12);
    assert_near(*rates.last().unwrap(), -2.0, 1e-5);
    // ½ I ω² = ½ k d² where the tip stands still.
    assert_near(deepest, 2.0 * (INERTIA / 1e5_f64).sqrt(), 2e-4);
    let soft = "wall={point=[0.0, 0.5], normal=[0.0, -1.0], stiffness=1e5, dissipation=0.3}";
    let mut lossy = self::plant(&[soft, "arm.position=[0.2]", "timing.integration_step=10us"]);
    lossy.advance(SECOND, &held(0.0));
    let back = lossy.state().velocity[0];
    assert!(back < -0.5 && back > -1.7, "slower than it came, {back}");
}

#[test]
fn a_wall_in_which_the_arm_starts_is_refused() {
    let sets: Vec<Override> =
        ["wall={point=[0.0, 0.5], normal=[0.0, -1.0]}"].map(|set| set.parse().unwrap()).to_vec();
    let error = Scenario::load("sampled/mtj", &sets).unwrap_err().to_string();
    assert!(error.contains("wall.point") && error.contains("in front of the tip"), "{error}");
}
