//! The integrator against solutions that share nothing with it: a library's method of order 8 on
//! equations written out here, closed forms, and conservation of energy.

#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_plant::engine::{Drive, State, engine};
use nalgebra::{DMatrix, DVector, Vector2};
use ode_solvers::{Dop853, System, dop_shared::OutputType};

const SECOND: u64 = 1_000_000_000;

fn scenario(name: &str, sets: &[&str]) -> Scenario {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Scenario::parse(name, built_in(name).unwrap(), &sets).unwrap()
}

fn torque(of_joints: &[f64]) -> Drive {
    Drive::Torque(std::array::from_fn(|i| of_joints.get(i).copied().unwrap_or(0.0)))
}

/// The two links of the paper, in the textbook's joint coordinates.
struct TwoLinks {
    gravity: f64,
}

const LENGTH: f64 = 1.0;
const CENTER: f64 = 0.5;
const MASS: [f64; 2] = [4.0, 3.0];
const INERTIA: [f64; 2] = [0.333, 0.30];

impl TwoLinks {
    fn inertia(q2: f64) -> [f64; 3] {
        let ([m1, m2], [i1, i2]) = (MASS, INERTIA);
        let h11 = i1
            + i2
            + m1 * CENTER * CENTER
            + m2 * (LENGTH * LENGTH + CENTER * CENTER + 2.0 * LENGTH * CENTER * q2.cos());
        let h12 = i2 + m2 * (CENTER * CENTER + LENGTH * CENTER * q2.cos());
        let h22 = i2 + m2 * CENTER * CENTER;
        [h11, h12, h22]
    }

    fn acceleration(&self, [q1, q2, v1, v2]: [f64; 4], [t1, t2]: [f64; 2]) -> [f64; 2] {
        let [h11, h12, h22] = Self::inertia(q2);
        let swing = MASS[1] * LENGTH * CENTER * q2.sin();
        let outer = MASS[1] * CENTER * self.gravity * (q1 + q2).cos();
        let inner = (MASS[0] * CENTER + MASS[1] * LENGTH) * self.gravity * q1.cos();
        let f1 = t1 + swing * v2 * (2.0 * v1 + v2) - inner - outer;
        let f2 = t2 - swing * v1 * v1 - outer;
        let determinant = h11 * h22 - h12 * h12;
        [(h22 * f1 - h12 * f2) / determinant, (h11 * f2 - h12 * f1) / determinant]
    }

    fn kinetic_energy([_, q2, v1, v2]: [f64; 4]) -> f64 {
        let [h11, h12, h22] = Self::inertia(q2);
        0.5 * (h11 * v1 * v1 + 2.0 * h12 * v1 * v2 + h22 * v2 * v2)
    }
}

/// Joint torques that give accelerations `a`: Newton's and Euler's equations from link to link.
fn newton_euler(scenario: &Scenario, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
    let links = &scenario.arm.links;
    let cross = |p: Vector2<f64>, f: Vector2<f64>| p.x * f.y - p.y * f.x;
    let turned = |p: Vector2<f64>| Vector2::new(-p.y, p.x);
    let (mut angle, mut rate, mut rate_change) = (0.0, 0.0, 0.0);
    let mut joint_acceleration = Vector2::zeros();
    let mut arms = Vec::new();
    for (i, link) in links.iter().enumerate() {
        angle += q[i];
        rate += v[i];
        rate_change += a[i];
        let along: Vector2<f64> = Vector2::new(angle.cos(), angle.sin());
        let at = |distance: f64| {
            joint_acceleration + (turned(along) * rate_change - along * (rate * rate)) * distance
        };
        let inertial = (at(link.center) * link.mass, link.inertia * rate_change);
        let next = at(link.length);
        arms.push((along * link.center, along * link.length, inertial));
        joint_acceleration = next;
    }
    let (mut force, mut moment) = (Vector2::zeros(), 0.0);
    let mut torques = vec![0.0; links.len()];
    for (i, (to_center, to_next, (pull, turn))) in arms.into_iter().enumerate().rev() {
        moment += turn + cross(to_center, pull) + cross(to_next, force);
        force += pull;
        torques[i] = moment;
    }
    torques
}

/// q̈ from [`newton_euler`], column by column.
fn acceleration(scenario: &Scenario, q: &[f64], v: &[f64], torque: &[f64]) -> Vec<f64> {
    let n = q.len();
    let rest = newton_euler(scenario, q, v, &vec![0.0; n]);
    let mut inertia = DMatrix::zeros(n, n);
    for j in 0..n {
        let unit: Vec<f64> = (0..n).map(|i| if i == j { 1.0 } else { 0.0 }).collect();
        let column = newton_euler(scenario, q, &vec![0.0; n], &unit);
        inertia.set_column(j, &DVector::from_vec(column));
    }
    let force = DVector::from_fn(n, |i, _| torque[i] - rest[i]);
    inertia.lu().solve(&force).unwrap().as_slice().to_vec()
}

/// The right-hand side of ẏ = rate(y).
struct Rate<F>(F);

impl<F: Fn(&[f64], &mut [f64])> System<f64, ode_solvers::DVector<f64>> for Rate<F> {
    fn system(&self, _: f64, y: &ode_solvers::DVector<f64>, rate: &mut ode_solvers::DVector<f64>) {
        self.0(y.as_slice(), rate.as_mut_slice());
    }
}

/// Integrates ẏ = rate(y) from `start` for `seconds` by Dormand and Prince's method of order 8.
fn of_order_eight(rate: impl Fn(&[f64], &mut [f64]), start: &[f64], seconds: f64) -> Vec<f64> {
    let start = ode_solvers::DVector::from_column_slice(start);
    let mut solver = Dop853::new(Rate(rate), 0.0, seconds, seconds, start, 1e-12, 1e-12);
    solver.set_output(OutputType::Sparse);
    solver.integrate().unwrap();
    solver.y_out().last().unwrap().as_slice().to_vec()
}

/// q, q̇ and the work done of an arm after `seconds` under a held torque.
fn simulated(scenario: &Scenario, held: &[f64], seconds: u64) -> Vec<f64> {
    let n = scenario.arm.links.len();
    let mut arm = engine(scenario);
    arm.advance(seconds * SECOND, &torque(held));
    let State { position, velocity, energy, .. } = arm.state();
    [&position[..n], &velocity[..n], &[energy]].concat()
}

fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (i, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() < tolerance, "entry {i}: {found} is not {expected}");
    }
}

fn check_two_links(gravity: f64, held: [f64; 2]) {
    let scenario = scenario(
        "sampled/mtj",
        &["timing.integration_step=100us", &format!("arm.gravity=[0.0, {:?}]", -gravity)],
    );
    let arm = TwoLinks { gravity };
    let rate = |y: &[f64], out: &mut [f64]| {
        let [a1, a2] = arm.acceleration([y[0], y[1], y[2], y[3]], held);
        let power = (held[0] * y[2]).abs() + (held[1] * y[3]).abs();
        out.copy_from_slice(&[y[2], y[3], a1, a2, power]);
    };
    let start = [0.03, std::f64::consts::FRAC_PI_2, 1.5, -1.0, 0.0];
    let expected = of_order_eight(rate, &start, 2.0);
    let found = simulated(&scenario, &held, 2);
    assert!((found[0] - start[0]).abs() > 0.5, "the arm moves: {found:?}");
    assert_close(&found[..4], &expected[..4], 1e-6);
    // The magnitude of the power has corners, which cost the solver digits.
    assert_close(&found[4..], &expected[4..], 1e-4);
}

#[test]
fn free_motion_of_two_links_agrees_with_a_method_of_order_eight() {
    check_two_links(0.0, [0.0, 0.0]);
}

#[test]
fn two_links_under_a_held_torque_agree_with_a_method_of_order_eight() {
    check_two_links(0.0, [2.0, -1.0]);
}

#[test]
fn two_links_under_gravity_agree_with_a_method_of_order_eight() {
    check_two_links(9.81, [5.0, 1.0]);
}

#[test]
fn three_links_agree_with_a_method_of_order_eight_on_newton_and_eulers_equations() {
    let scenario = scenario(
        "redundant/mtj",
        &["timing.integration_step=100us", "arm.velocity=[0.4, -1.1, 0.8]"],
    );
    let held = [1.2, -0.7, 0.3];
    let rate = |y: &[f64], out: &mut [f64]| {
        let a = acceleration(&scenario, &y[..3], &y[3..6], &held);
        out[..3].copy_from_slice(&y[3..6]);
        out[3..].copy_from_slice(&a);
    };
    let expected = of_order_eight(rate, &[0.1, 0.9, 0.7, 0.4, -1.1, 0.8], 2.0);
    assert_close(&simulated(&scenario, &held, 2)[..6], &expected, 1e-6);
}

#[test]
fn the_error_shrinks_sixteenfold_when_the_step_halves() {
    let after = |step: &str| {
        let step = format!("timing.integration_step={step}");
        simulated(&scenario("sampled/mtj", &[&step]), &[2.0, -1.0], 1)
    };
    let exact = after("100us");
    let error = |step| {
        let difference =
            after(step).iter().zip(&exact).take(4).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        difference.sqrt()
    };
    let (coarse, middle, fine) = (error("10ms"), error("5ms"), error("2500us"));
    for ratio in [coarse / middle, middle / fine] {
        assert!((14.0..18.0).contains(&ratio), "fourth order: {coarse} {middle} {fine}");
    }
}

#[test]
fn an_interval_that_is_no_multiple_of_the_step_is_divided_evenly() {
    let scenario = scenario("sampled/mtj", &["timing.integration_step=1ms"]);
    let mut whole = engine(&scenario);
    let mut broken = engine(&scenario);
    let drive = torque(&[2.0, -1.0]);
    whole.advance(SECOND, &drive);
    for time_ns in (1..=SECOND / 777_777).map(|i| i * 777_777).chain([SECOND]) {
        broken.advance(time_ns, &drive);
        assert_eq!(broken.state().time_ns, time_ns);
    }
    assert_close(&broken.state().position, &whole.state().position, 1e-10);
    broken.advance(SECOND / 2, &drive);
    assert_eq!(broken.state().time_ns, SECOND, "time does not run backwards");
}

#[test]
fn work_that_is_never_negative_equals_the_kinetic_energy_gained() {
    // H(q) (1, 1): both joints speed up together, from rest.
    let scenario =
        scenario("sampled/mtj", &["arm.velocity=[0.0, 0.0]", "timing.integration_step=100us"]);
    let [h11, h12, h22] = TwoLinks::inertia(std::f64::consts::FRAC_PI_2);
    let held = [h11 + h12, h12 + h22];
    let mut arm = engine(&scenario);
    for i in 1..=50 {
        arm.advance(i * SECOND / 100, &torque(&held));
        let (q, v) = (arm.state().position, arm.state().velocity);
        assert!(held[0] * v[0] >= 0.0 && held[1] * v[1] >= 0.0, "power is not negative here");
        let gained = TwoLinks::kinetic_energy([q[0], q[1], v[0], v[1]]);
        assert!(
            (arm.state().energy - gained).abs() < 1e-9,
            "{} J done, {gained} J gained",
            arm.state().energy
        );
    }
    assert!(arm.state().energy > 1.0);
}

#[test]
fn braking_counts_as_work_too() {
    // One link of 0.333 + 4 · 0.5² kg m² at 2 rad/s against −1 N m: it stops and comes back, and
    // I v² / 2 is spent twice.
    let inertia = 0.333 + 4.0 * 0.25;
    let scenario = scenario(
        "sampled/tj",
        &[
            "arm.links=[{length = 1.0, mass = 4.0, center = 0.5, inertia = 0.333}]",
            "trajectory={kind = \"circle\", radius = 1.0, angular_frequency = 0.1}",
            "arm.position=[0.0]",
            "arm.velocity=[2.0]",
            "timing.integration_step=100us",
        ],
    );
    let mut arm = engine(&scenario);
    let turn = (2.0 * inertia * 1e9) as u64;
    arm.advance(turn, &torque(&[-1.0]));
    assert!(arm.state().velocity[0].abs() < 1e-7, "it has stopped");
    assert!((arm.state().position[0] - 2.0 * inertia).abs() < 1e-7, "v² I / 2 τ further on");
    arm.advance(2 * turn, &torque(&[-1.0]));
    assert!((arm.state().velocity[0] + 2.0).abs() < 1e-7);
    assert!((arm.state().energy - inertia * 4.0).abs() < 1e-6, "{} J", arm.state().energy);
}

#[test]
fn damping_slows_a_joint_exponentially_and_never_beyond_its_limit() {
    let inertia = 0.333 + 4.0 * 0.25;
    let scenario = scenario(
        "sampled/tj",
        &[
            "arm.links=[{length = 1.0, mass = 4.0, center = 0.5, inertia = 0.333}]",
            "trajectory={kind = \"circle\", radius = 1.0, angular_frequency = 0.1}",
            "arm.position=[0.0]",
            "arm.velocity=[2.0]",
        ],
    );
    let mut free = engine(&scenario);
    free.advance(SECOND, &Drive::Damping { damping: 1.5, limit: [f64::INFINITY; 7] });
    let expected = 2.0 * f64::exp(-1.5 / inertia);
    assert!((free.state().velocity[0] - expected).abs() < 1e-9);
    let mut limited = engine(&scenario);
    limited.advance(SECOND, &Drive::Damping { damping: 1.5, limit: [0.6; 7] });
    assert!(
        (limited.state().velocity[0] - (2.0 - 0.6 / inertia)).abs() < 1e-9,
        "0.6 N m all the time"
    );
}
