//! The paper's two links and its path, worked out here in the textbook's joint coordinates: nothing
//! is taken from the crates under test but the samples themselves.

#![allow(dead_code, reason = "each test file takes what it needs")]
#![allow(clippy::unwrap_used, reason = "a helper that cannot go on fails its test")]

use std::collections::VecDeque;

use mtj_controller::Controller;
use mtj_model::scenario::{Override, Scenario, built_in};
use mtj_protocol::sample::{Header, StateSample, TorqueSample, VERSION, padded};
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

/// rms of the tracking error, mm, over the second half of 20 s on the paper's two links and path: a
/// sample every 10 ms, whose answer takes effect `latency_ms` after it. `sets` are laid over the
/// built-in `sampled/mb`.
pub(crate) fn rms_mm(sets: &[&str], latency_ms: u64) -> f64 {
    let mut controller = Controller::new(&scenario("sampled/mb", sets));
    let mut joints = [0.03, std::f64::consts::FRAC_PI_2, 1.5, -1.0];
    let (mut torque, mut echo, mut latency_ns) = ([0.0; 2], [0.0; 7], 0);
    let (mut delivered, mut sum) = ([0.0; 7], 0.0);
    let mut on_their_way = VecDeque::from([]);
    for time_ms in 0..20_000 {
        let is_sample = time_ms % 10 == 0;
        for turn in 0..2 {
            while let Some((sampled_ms, answer)) = on_their_way.front().copied()
                && sampled_ms + latency_ms <= time_ms
            {
                let answer: TorqueSample = answer;
                on_their_way.pop_front();
                (torque, echo) = ([answer.torque[0], answer.torque[1]], answer.echo);
                latency_ns = latency_ms * 1_000_000;
            }
            if turn == 0 && is_sample {
                let [q1, q2, v1, v2] = joints;
                let mut state = state(time_ms, [q1, q2], [v1, v2]);
                (state.applied, state.delivered, state.latency_ns) = (echo, delivered, latency_ns);
                on_their_way.push_back((time_ms, *controller.respond(&state).unwrap()));
                delivered = [0.0; 7];
                let (e, _) = tracking_error(&state);
                sum += if time_ms < 10_000 { 0.0 } else { e[0] * e[0] + e[1] * e[1] };
            }
        }
        for (mean, held) in delivered.iter_mut().zip(echo) {
            *mean += held / 10.0;
        }
        joints = moved(joints, torque, 1e-3);
    }
    1e3 * (sum / 1000.0).sqrt()
}

/// q and q̇ a time later under a torque, by the Runge–Kutta method of order four.
fn moved(start: [f64; 4], torque: Plane, h: f64) -> [f64; 4] {
    let rate = |[q1, q2, v1, v2]: [f64; 4]| {
        let [a1, a2] = acceleration([q1, q2], [v1, v2], torque);
        [v1, v2, a1, a2]
    };
    let plus = |k: [f64; 4], h: f64| std::array::from_fn(|i| start[i] + h * k[i]);
    let k1 = rate(start);
    let k2 = rate(plus(k1, h / 2.0));
    let k3 = rate(plus(k2, h / 2.0));
    let k4 = rate(plus(k3, h));
    plus(std::array::from_fn(|i| (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]) / 6.0), h)
}

/// Fails unless a law has the rms errors, mm, that a table lists for latencies, ms.
pub(crate) fn assert_tabled(sets: &[&str], table: &[(u64, f64)], tolerance: f64) {
    for (latency_ms, expected) in table {
        let found = rms_mm(sets, *latency_ms);
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{sets:?}, {latency_ms} ms: {found} mm, not {expected} mm"
        );
    }
}

/// A⁻¹ x.
pub(crate) fn solve(a: [Plane; 2], x: Plane) -> Plane {
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    [
        (a[1][1] * x[0] - a[0][1] * x[1]) / determinant,
        (a[0][0] * x[1] - a[1][0] * x[0]) / determinant,
    ]
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
