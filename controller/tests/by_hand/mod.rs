//! The paper's two links and its path, worked out here in the textbook's joint coordinates: nothing
//! is taken from the crates under test but the samples themselves.

#![allow(dead_code, reason = "each test file takes what it needs")]
#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_protocol::sample::{Header, StateSample, VERSION, padded};
use nalgebra::{RowSVector, SMatrix};

/// A vector in the plane.
pub(crate) type Plane = [f64; 2];

/// A link's length, mass, centre of mass and moment of inertia about it.
pub(crate) type Link = [f64; 4];

/// The paper's two links.
pub(crate) const TWO_LINKS: [Link; 2] = [[1.0, 4.0, 0.5, 0.333], [1.0, 3.0, 0.5, 0.30]];
/// Those of the redundant arm.
pub(crate) const THREE_LINKS: [Link; 3] =
    [[0.8, 4.0, 0.4, 0.213], [0.7, 3.0, 0.35, 0.123], [0.5, 2.0, 0.25, 0.042]];

const MASS: Plane = [4.0, 3.0];
const INERTIA: Plane = [0.333, 0.30];

/// The built-in scenario with some keys set.
pub(crate) fn scenario(name: &str, sets: &[&str]) -> Scenario {
    let sets: Vec<Override> = sets.iter().map(|set| set.parse().unwrap()).collect();
    Scenario::parse(name, built_in(name).unwrap(), &sets).unwrap()
}

/// A controller for the two links with some keys set.
pub(crate) fn controller(sets: &[&str]) -> Controller {
    Controller::new(&scenario("sampled/mtj", sets))
}

/// A state of an arm at a time in ms.
pub(crate) fn state<const N: usize>(time_ms: u64, q: [f64; N], v: [f64; N]) -> StateSample {
    let header = Header {
        version: VERSION,
        joints: N as u32,
        axes: 2,
        run: 1,
        sequence: time_ms,
        time_ns: time_ms * 1_000_000,
        ..Header::default()
    };
    StateSample { header, position: padded(&q), velocity: padded(&v), ..Default::default() }
}

/// Some motion of the joints, so that samples differ.
pub(crate) fn swinging(time_ms: u64) -> StateSample {
    let t = time_ms as f64 * 1e-3;
    state(time_ms, [0.1 + 0.7 * t, 1.4 - 0.3 * t], [1.2 - 2.0 * t, -0.8 + 3.0 * t * t])
}

/// The same, with an echo that came back from the plant.
pub(crate) fn echoing(time_ms: u64) -> StateSample {
    let mut state = swinging(time_ms);
    let number = time_ms as f64;
    (state.applied[0], state.applied[1]) = (number + 1.0, -number);
    (state.delivered[0], state.delivered[1]) = (0.5 * number, number - 7.0);
    state
}

/// Where the tip is.
pub(crate) fn tip([q1, q2]: Plane) -> Plane {
    [q1.cos() + (q1 + q2).cos(), q1.sin() + (q1 + q2).sin()]
}

/// The rows of J.
pub(crate) fn jacobian([q1, q2]: Plane) -> [Plane; 2] {
    let (s1, c1, s12, c12) = (q1.sin(), q1.cos(), (q1 + q2).sin(), (q1 + q2).cos());
    [[-s1 - s12, -s12], [c1 + c12, c12]]
}

/// A x.
pub(crate) fn times(a: [Plane; 2], x: Plane) -> Plane {
    [a[0][0] * x[0] + a[0][1] * x[1], a[1][0] * x[0] + a[1][1] * x[1]]
}

/// Aᵀ x.
pub(crate) fn transpose_times(a: [Plane; 2], x: Plane) -> Plane {
    [a[0][0] * x[0] + a[1][0] * x[1], a[0][1] * x[0] + a[1][1] * x[1]]
}

/// a x + b y.
pub(crate) fn mix(a: f64, x: Plane, b: f64, y: Plane) -> Plane {
    [a * x[0] + b * y[0], a * x[1] + b * y[1]]
}

/// ‖x‖.
pub(crate) fn norm(x: Plane) -> f64 {
    x[0].hypot(x[1])
}

/// The desired position, velocity and acceleration of eq. (18) with ω = 1 at a time in s.
pub(crate) fn desired(t: f64) -> [Plane; 3] {
    let (radius, angle) = (2f64.sqrt(), t + std::f64::consts::FRAC_PI_4);
    let (x, y) = (radius * angle.cos(), radius * angle.sin());
    let ripple = 0.1 * (5.0 * t).sin();
    let rate = 0.5 * (5.0 * t).cos();
    let change = -2.5 * (5.0 * t).sin();
    [[x + ripple, y + ripple], [-y + rate, x + rate], [-x + change, -y + change]]
}

/// e and ė of a state against the desired motion at its own time.
pub(crate) fn tracking_error(state: &StateSample) -> (Plane, Plane) {
    let (q, v) = joints(state);
    let [position, velocity, _] = desired(state.header.time_ns as f64 * 1e-9);
    (mix(1.0, position, -1.0, tip(q)), mix(1.0, velocity, -1.0, times(jacobian(q), v)))
}

/// q and q̇ of a state.
pub(crate) fn joints(state: &StateSample) -> (Plane, Plane) {
    ([state.position[0], state.position[1]], [state.velocity[0], state.velocity[1]])
}

/// q̈ of the two links under a torque, from H and C in joint coordinates.
pub(crate) fn acceleration([_, q2]: Plane, [v1, v2]: Plane, torque: Plane) -> Plane {
    let h11 = INERTIA[0] + INERTIA[1] + MASS[0] * 0.25 + MASS[1] * (1.25 + q2.cos());
    let h12 = INERTIA[1] + MASS[1] * (0.25 + 0.5 * q2.cos());
    let h22 = INERTIA[1] + MASS[1] * 0.25;
    let swing = MASS[1] * 0.5 * q2.sin();
    let f1 = torque[0] + swing * v2 * (2.0 * v1 + v2);
    let f2 = torque[1] - swing * v1 * v1;
    let determinant = h11 * h22 - h12 * h12;
    [(h22 * f1 - h12 * f2) / determinant, (h11 * f2 - h12 * f1) / determinant]
}

/// The rows of (J H⁻¹ Jᵀ)⁻¹, from the Jacobians of the centres of mass and a general inverse.
pub(crate) fn task_inertia<const N: usize>(links: &[Link; N], q: [f64; N]) -> [Plane; 2] {
    let mut angle = 0.0;
    let angles = q.map(|q| {
        angle += q;
        angle
    });
    // Of the point at which one arrives going so far along each link.
    let jacobian = |along: [f64; N]| {
        SMatrix::<f64, 2, N>::from_fn(|row, joint| {
            let part =
                |i: usize| along[i] * if row == 0 { -angles[i].sin() } else { angles[i].cos() };
            (joint..N).map(part).sum()
        })
    };
    let mut inertia = SMatrix::<f64, N, N>::zeros();
    for (i, [_, mass, center, about_it]) in links.iter().enumerate() {
        let along = |k: usize| if k < i { links[k][0] } else { 0.0 };
        let speed = jacobian(std::array::from_fn(|k| if k == i { *center } else { along(k) }));
        let turn = RowSVector::<f64, N>::from_fn(|_, joint| if joint <= i { 1.0 } else { 0.0 });
        inertia += speed.transpose() * speed * *mass + turn.transpose() * turn * *about_it;
    }
    let tip = jacobian(links.map(|[length, ..]| length));
    let mobility = tip * inertia.try_inverse().unwrap() * tip.transpose();
    let all = mobility.try_inverse().unwrap();
    [[all[(0, 0)], all[(0, 1)]], [all[(1, 0)], all[(1, 1)]]]
}

/// J̇ q̇: how the tip accelerates when no joint does.
pub(crate) fn bend([q1, q2]: Plane, [v1, v2]: Plane) -> Plane {
    let outer = (v1 + v2) * (v1 + v2);
    [-v1 * v1 * q1.cos() - outer * (q1 + q2).cos(), -v1 * v1 * q1.sin() - outer * (q1 + q2).sin()]
}

/// Fails unless the leading two entries of `found` are `expected`, to rounding.
pub(crate) fn assert_close(found: &[f64], expected: Plane, what: &str) {
    for i in 0..2 {
        let scale = expected[i].abs().max(1.0);
        assert!(
            (found[i] - expected[i]).abs() < 1e-11 * scale,
            "{what}: {:?} is not {expected:?}",
            &found[..2]
        );
    }
    assert!(found[2..].iter().all(|rest| *rest == 0.0), "{what}: nothing past the count");
}

/// The same where differences of speeds, divided by a short time, are in it.
pub(crate) fn assert_nearly(found: &[f64], expected: Plane, what: &str) {
    let off = norm(mix(1.0, [found[0], found[1]], -1.0, expected));
    assert!(off < 1e-9, "{what}: {:?} is not {expected:?}", &found[..2]);
}
