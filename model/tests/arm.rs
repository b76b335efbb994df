//! The arm's equations against derivations that share nothing with them: positions of the centres
//! of mass written out link by link, finite differences, and conservation of energy.

use mtj_model::{
    arm::{
        Arm, Kinematics, TaskDynamics, mobility,
        planar::{Configuration, PlanarArm, RigidLink},
    },
    matrix,
};
use nalgebra::{SMatrix, SVector, Vector2};

fn links<const N: usize>() -> [RigidLink<f64>; N] {
    std::array::from_fn(|i| {
        let i = i as f64;
        let length = 1.0 - 0.09 * i;
        RigidLink {
            length,
            mass: 4.0 - 0.5 * i,
            center: 0.45 * length + 0.01 * i,
            inertia: 0.3 - 0.03 * i,
        }
    })
}

fn angles<const N: usize>() -> SVector<f64, N> {
    SVector::from_fn(|i, _| 0.4 + 0.55 * (1.7 * i as f64).sin())
}

fn rates<const N: usize>() -> SVector<f64, N> {
    SVector::from_fn(|i, _| 0.9 * (0.3 + 2.1 * i as f64).cos())
}

/// Kinetic energy, from the velocity of each centre of mass by central differences of its position.
fn kinetic_energy<const N: usize>(
    links: &[RigidLink<f64>; N],
    q: &SVector<f64, N>,
    q_dot: &SVector<f64, N>,
) -> f64 {
    let h = 1e-3;
    // A fourth-order difference along the motion.
    let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(|s| centers(links, &(q + q_dot * (s * h))));
    let mut energy = 0.0;
    let mut rate = 0.0;
    for i in 0..N {
        let velocity = (a[i] - b[i] * 8.0 + c[i] * 8.0 - d[i]) / (12.0 * h);
        rate += q_dot[i];
        energy += 0.5 * (links[i].mass * velocity.norm_squared() + links[i].inertia * rate * rate);
    }
    energy
}

fn centers<const N: usize>(links: &[RigidLink<f64>; N], q: &SVector<f64, N>) -> [Vector2<f64>; N] {
    let mut joint = Vector2::zeros();
    let mut angle = 0.0;
    std::array::from_fn(|i| {
        angle += q[i];
        let direction = Vector2::new(angle.cos(), angle.sin());
        let center = joint + direction * links[i].center;
        joint += direction * links[i].length;
        center
    })
}

fn potential_energy<const N: usize>(
    links: &[RigidLink<f64>; N],
    gravity: &Vector2<f64>,
    q: &SVector<f64, N>,
) -> f64 {
    -centers(links, q).iter().zip(links).map(|(p, link)| link.mass * gravity.dot(p)).sum::<f64>()
}

fn unit<const N: usize>(i: usize) -> SVector<f64, N> {
    SVector::from_fn(|j, _| if i == j { 1.0 } else { 0.0 })
}

macro_rules! for_one_two_three_and_seven_links {
    ($($name:ident = $check:ident;)*) => {
        $(#[test] fn $name() { $check::<1>(); $check::<2>(); $check::<3>(); $check::<7>(); })*
    };
}

for_one_two_three_and_seven_links! {
    inertia_is_the_second_derivative_of_the_kinetic_energy = check_inertia;
    every_link_ends_where_its_centre_of_mass_says = check_ends;
    the_jacobian_agrees_with_finite_differences = check_jacobian;
    velocity_terms_follow_from_lagranges_equation = check_velocity_terms;
    energy_is_conserved_without_torque = check_energy;
    acceleration_solves_the_equation_of_motion = check_acceleration;
    the_mobility_is_the_acceleration_of_the_tip_for_a_unit_of_force = check_mobility;
    the_regressor_of_the_own_parameters_is_the_equation_of_motion = check_regressor;
    rotors_add_to_the_diagonal_of_the_inertia_and_to_nothing_else = check_rotors;
}

fn check_inertia<const N: usize>() {
    let links = links::<N>();
    let arm = PlanarArm::new(&links, Vector2::zeros());
    let h = arm.inertia(&Configuration::new(&angles(), &rates()));
    // The kinetic energy is quadratic in q̇, so differences of step one are exact.
    let energy = |v: SVector<f64, N>| kinetic_energy(&links, &angles(), &v);
    for i in 0..N {
        for j in 0..N {
            let second = energy(unit(i) + unit(j)) - energy(unit(i)) - energy(unit(j));
            let second = if i == j { 2.0 * energy(unit(i)) } else { second };
            assert!((h[(i, j)] - second).abs() < 1e-8, "H[{i}{j}] = {} not {second}", h[(i, j)]);
        }
    }
}

fn check_ends<const N: usize>() {
    let links = links::<N>();
    let arm = PlanarArm::new(&links, Vector2::zeros());
    let at = Configuration::new(&angles(), &rates());
    let centers = centers(&links, &angles());
    let (ends, mut start) = (arm.ends(&at), Vector2::zeros());
    for i in 0..N {
        let center = start + (ends[i] - start) * (links[i].center / links[i].length);
        assert!((center - centers[i]).norm() < 1e-12, "link {i}: {center} is not {}", centers[i]);
        start = ends[i];
    }
    let tip: Vector2<f64> = arm.tip(&at);
    assert!((start - tip).norm() < 1e-12);
}

fn check_jacobian<const N: usize>() {
    let arm = PlanarArm::new(&links::<N>(), Vector2::zeros());
    let (q, q_dot, h) = (angles(), rates(), 1e-5);
    let at = Configuration::new(&q, &q_dot);
    let jacobian: SMatrix<f64, 3, N> = arm.jacobian(&at);
    for j in 0..N {
        let ahead: SVector<f64, 3> = arm.tip(&Configuration::new(&(q + unit(j) * h), &q_dot));
        let behind: SVector<f64, 3> = arm.tip(&Configuration::new(&(q - unit(j) * h), &q_dot));
        assert!(((ahead - behind) / (2.0 * h) - jacobian.column(j)).norm() < 1e-9);
    }
    assert!((jacobian * q_dot - arm.tip_velocity(&at)).norm() < 1e-14);
    let ahead: SMatrix<f64, 3, N> = arm.jacobian(&Configuration::new(&(q + q_dot * h), &q_dot));
    let behind: SMatrix<f64, 3, N> = arm.jacobian(&Configuration::new(&(q - q_dot * h), &q_dot));
    let rate = (ahead - behind) / (2.0 * h) * q_dot;
    assert!((rate - arm.jacobian_rate_velocity(&at)).norm() < 1e-8);
}

/// C = d/dt(∂T/∂q̇)|_{q̈ = 0} − ∂T/∂q + ∂V/∂q.
fn check_velocity_terms<const N: usize>() {
    let links = links::<N>();
    let gravity = Vector2::new(1.2, -9.81);
    let arm = PlanarArm::new(&links, gravity);
    let (q, q_dot, h) = (angles(), rates(), 1e-4);
    let inertia = |q: SVector<f64, N>| arm.inertia(&Configuration::new(&q, &q_dot));
    let momentum_rate = (inertia(q + q_dot * h) - inertia(q - q_dot * h)) / (2.0 * h) * q_dot;
    let c = arm.velocity_terms(&Configuration::new(&q, &q_dot));
    for i in 0..N {
        let along = |f: &dyn Fn(SVector<f64, N>) -> f64| {
            (f(q + unit(i) * h) - f(q - unit(i) * h)) / (2.0 * h)
        };
        let kinetic = along(&|q| kinetic_energy(&links, &q, &q_dot));
        let potential = along(&|q| potential_energy(&links, &gravity, &q));
        let expected = momentum_rate[i] - kinetic + potential;
        assert!((c[i] - expected).abs() < 1e-5, "C[{i}] = {} not {expected}", c[i]);
    }
}

fn check_energy<const N: usize>() {
    let links = links::<N>();
    let gravity = Vector2::new(0.0, -9.81);
    let arm = PlanarArm::new(&links, gravity);
    let energy = |q: &SVector<f64, N>, v: &SVector<f64, N>| {
        kinetic_energy(&links, q, v) + potential_energy(&links, &gravity, q)
    };
    let (mut q, mut v, h) = (angles::<N>(), rates::<N>(), 1e-4);
    let start = energy(&q, &v);
    for _ in 0..10_000 {
        // The explicit midpoint rule, written here on purpose.
        let a = arm.acceleration(&Configuration::new(&q, &v), &SVector::zeros());
        let (middle_q, middle_v) = (q + v * (h / 2.0), v + a * (h / 2.0));
        let middle_at = Configuration::new(&middle_q, &middle_v);
        let middle_a = arm.acceleration(&middle_at, &SVector::zeros());
        q += middle_v * h;
        v += middle_a * h;
    }
    let end = energy(&q, &v);
    assert!((q - angles::<N>()).norm() > 0.1, "the arm swings");
    assert!((end - start).abs() < 2e-4 * start.abs().max(1.0), "{N} links: {start} J to {end} J");
}

fn check_acceleration<const N: usize>() {
    let arm = PlanarArm::new(&links::<N>(), Vector2::new(0.3, -9.81));
    let torque = SVector::from_fn(|i, _| 3.0 - 1.1 * i as f64);
    let at = Configuration::new(&angles(), &rates());
    let acceleration = arm.acceleration(&at, &torque);
    let balance = matrix::times(&arm.inertia(&at), &acceleration) + arm.velocity_terms(&at);
    assert!((balance - torque).norm() < 1e-11);
}

/// At rest and without gravity, where the tip accelerates by J q̈ alone.
fn check_mobility<const N: usize>() {
    let arm = PlanarArm::new(&links::<N>(), Vector2::zeros());
    let at = Configuration::new(&angles(), &SVector::zeros());
    let jacobian: SMatrix<f64, 2, N> = arm.jacobian(&at);
    let mobility = mobility(&arm.inertia(&at), &jacobian);
    for (axis, force) in [Vector2::new(1.0, 0.0), Vector2::new(0.0, 1.0)].iter().enumerate() {
        let tip = jacobian * arm.acceleration(&at, &(jacobian.transpose() * force));
        assert!((tip - mobility.column(axis)).norm() < 1e-12, "{tip} is not {mobility}");
    }
}

fn check_regressor<const N: usize>() {
    let gravity = Vector2::new(1.3, -9.81);
    let arm = PlanarArm::new(&links::<N>(), gravity);
    let (q, v) = (angles::<N>(), rates::<N>());
    let at = Configuration::new(&q, &v);
    let a = SVector::<f64, N>::from_fn(|i, _| 1.0 - 0.7 * i as f64);
    let own = arm.parameters();
    let torque = arm.regressor_times(&at, &v, &a, &own);
    let expected = arm.inertia(&at) * a + arm.velocity_terms(&at);
    assert!((torque - expected).norm() < 1e-12 * expected.norm(), "{N}: {torque} not {expected}");
    // Y is the same for both products.
    let other = own.map(|p| (3.0 * p).sin());
    let r = SVector::<f64, N>::from_fn(|i, _| 0.3 + 0.4 * i as f64);
    let s = SVector::<f64, N>::from_fn(|i, _| 0.8 - 0.5 * i as f64);
    let slope = arm.regressor_transpose_times(&at, &r, &a, &s);
    let along: f64 = slope.iter().zip(other).map(|(slope, p)| slope * p).sum();
    let power = s.dot(&arm.regressor_times(&at, &r, &a, &other));
    assert!((along - power).abs() < 1e-12 * (1.0 + power.abs()), "{N}: {along}, {power}");
    assert!(slope[2 * N..].iter().chain(&own[2 * N..]).all(|rest| *rest == 0.0));
    // sᵀ (Ḣ − 2 C) s = 0, with Ḣ by a central difference along the motion.
    let h = 1e-5;
    let [before, after] = [-h, h].map(|h| arm.inertia(&Configuration::new(&(q + v * h), &v)) * s);
    let coriolis = arm.regressor_times(&at, &s, &SVector::zeros(), &own) - arm.gravity(&q);
    let rate = s.dot(&(after - before)) / (2.0 * h);
    assert!((rate - 2.0 * s.dot(&coriolis)).abs() < 1e-7, "{N}: {rate}, {coriolis}");
}

fn check_rotors<const N: usize>() {
    let without = PlanarArm::new(&links::<N>(), Vector2::new(0.3, -9.81));
    let rotors: [f64; N] = std::array::from_fn(|i| 0.4 + 0.3 * i as f64);
    let arm = without.with_rotors(rotors);
    let at = Configuration::new(&angles(), &rates());
    let inertia = without.inertia(&at) + SMatrix::from_diagonal(&rotors.into());
    assert!((arm.inertia(&at) - inertia).norm() < 1e-12 * inertia.norm(), "{N}");
    assert_eq!(arm.velocity_terms(&at), without.velocity_terms(&at));
    let torque = SVector::from_fn(|i, _| 3.0 - 1.1 * i as f64);
    let acceleration = arm.acceleration(&at, &torque);
    let balance = inertia * acceleration + without.velocity_terms(&at);
    assert!((balance - torque).norm() < 1e-11, "{N}: {balance} is not {torque}");
    // They are known, and no parameters.
    let own = arm.parameters();
    for (one, other) in own.iter().zip(without.parameters()) {
        assert!((one - other).abs() < 1e-12, "{N}: {one}, {other}");
    }
    let model = arm.regressor_times(&at, &rates(), &acceleration, &own);
    assert!((model - torque).norm() < 1e-11, "{N}: {model} is not {torque}");
}

#[test]
fn task_dynamics_give_the_force_that_makes_the_tip_accelerate() {
    let arm = PlanarArm::new(&links::<2>(), Vector2::zeros());
    let at = Configuration::new(&angles(), &rates());
    let jacobian: SMatrix<f64, 2, 2> = arm.jacobian(&at);
    let inverse = jacobian.try_inverse().expect("not singular here");
    let bend: Vector2<f64> = arm.jacobian_rate_velocity(&at);
    let dynamics = TaskDynamics::new(&arm.inertia(&at), &arm.velocity_terms(&at), &inverse, &bend);
    let wanted = Vector2::new(0.7, -1.9);
    let force = dynamics.inertia * wanted + dynamics.velocity_terms;
    let joint = arm.acceleration(&at, &(jacobian.transpose() * force));
    let tip = jacobian * joint + bend;
    assert!((tip - wanted).norm() < 1e-12);
}

#[test]
fn the_arm_works_in_single_precision_too() {
    let links = links::<3>().map(|link| RigidLink {
        length: link.length as f32,
        mass: link.mass as f32,
        center: link.center as f32,
        inertia: link.inertia as f32,
    });
    let arm = PlanarArm::new(&links, Vector2::zeros());
    let single = arm.inertia(&Configuration::new(&angles::<3>().cast(), &rates::<3>().cast()));
    let double = PlanarArm::new(&self::links::<3>(), Vector2::zeros());
    let double = double.inertia(&Configuration::new(&angles(), &rates()));
    assert!((single.cast::<f64>() - double).norm() < 1e-5);
}
