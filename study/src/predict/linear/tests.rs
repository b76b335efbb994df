//! The statements of `docs/latency.md`, compared with the step matrix of the loop.

mod inner_loop;
mod margins;
mod mass;
mod memory;

use mtj_model::{
    gains::Gains,
    law::{
        factor::Factor, mass::Mass, mb::ModelBased, mtj::ModifiedTransposeJacobian, tdc::TimeDelay,
        tj::TransposeJacobian,
    },
};
use nalgebra::Complex;

use super::*;

/// mtj's gains, N/m and N s/m, and k.
#[derive(Clone, Copy, Debug)]
struct Memory {
    kp: f64,
    kd: f64,
    k: f64,
}

const PAPER: Memory = Memory { kp: 30.0, kd: 60.0, k: 0.99 };

/// T_s, s, unless a test says otherwise.
const PERIOD: f64 = 0.01;

const POLICIES: [MemoryPolicy; 3] =
    [MemoryPolicy::Sent, MemoryPolicy::Applied, MemoryPolicy::Delivered];

/// Effective masses along the paper's path, kg.
const MASSES: [f64; 5] = [1.05, 1.5, 2.0, 3.0, 4.4];

/// Latencies from none to several periods, whole ones among them, s.
const LATENCIES: [f64; 9] = [0.0, 0.001, 0.005, 0.0099, 0.01, 0.0137, 0.02, 0.0333, 0.05];

fn gain<const M: usize>(gain: f64) -> Gains<f64, M> {
    Gains::Diagonal(SVector::repeat(gain))
}

/// mtj with a constant k, and with the term M̄ ë of eq. (11) if a mass is given.
fn mtj(Memory { kp, kd, k }: Memory, mass: Option<f64>) -> Law<f64, 1> {
    Law::Mtj(ModifiedTransposeJacobian {
        tj: TransposeJacobian { kp: gain(kp), kd: gain(kd) },
        factor: Factor::constant(k),
        acceleration: mass.map(|mass| Mass::Constant(gain(mass))),
    })
}

/// Time-delay control with gains in 1/s² and 1/s and k = 1.
fn tdc<const M: usize>(kp: f64, kd: f64, mass: f64) -> Law<f64, M> {
    Law::Tdc(TimeDelay {
        kp: gain(kp),
        kd: gain(kd),
        mass: Mass::Constant(gain(mass)),
        factor: Factor::constant(1.0),
    })
}

/// Computed torque with gains in 1/s² and 1/s; it inverts Jacobians of two axes only.
fn mb(kp: f64, kd: f64) -> Law<f64, 2> {
    Law::Mb(ModelBased { kp: gain(kp), kd: gain(kd) })
}

/// A loop at T_s = 10 ms without prediction, whose model has the right mass.
fn held<const M: usize>(
    law: Law<f64, M>,
    mass: f64,
    memory: MemoryPolicy,
    latency: f64,
) -> LinearLoop<M> {
    LinearLoop { law, mass, model_mass: mass, period: PERIOD, latency, memory, predicts: false }
}

/// The largest difference between the entries of two step matrices.
fn difference(one: &LinearLoop<1>, other: &LinearLoop<1>) -> f64 {
    (one.step_matrix() - other.step_matrix()).amax()
}

/// det(z − A) of a step matrix A.
fn characteristic(of: &LinearLoop<2>, z: Complex<f64>) -> Complex<f64> {
    let matrix = of.step_matrix().map(|entry| Complex::new(entry, 0.0));
    let size = matrix.nrows();
    (DMatrix::from_diagonal_element(size, size, z) - matrix).determinant()
}

/// The least number from `least` to `most` from which on `is_stable`.
fn critical(least: f64, most: f64, is_stable: impl Fn(f64) -> bool) -> f64 {
    assert!(is_stable(most) && !is_stable(least));
    most - close_in(0.0, most - least, |below| is_stable(most - below))
}
