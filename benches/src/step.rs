//! A law alone, as the paper counts it: N = M, all matrices full, and everything that follows from
//! the arm's configuration given. A step is the law's task force and then τ = Jᵀ Q̂.

use std::hint::black_box;

use mtj_model::{
    JointCount,
    arm::TaskDynamics,
    for_joints,
    gains::Gains,
    law::{
        factor::{Factor, FactorKind, Thresholds},
        mb::ModelBased,
        mtj::ModifiedTransposeJacobian,
        tj::TransposeJacobian,
    },
    matrix,
    task::TrackingError,
};
use nalgebra::{SMatrix, SVector};

use crate::{law::Law, meter::Meter};

/// The laws at one size.
struct Laws<const N: usize> {
    tj: TransposeJacobian<f64, N>,
    mtj: ModifiedTransposeJacobian<f64, N>,
    mb: ModelBased<f64, N>,
}

/// What a step is given.
struct Given<const N: usize> {
    error: TrackingError<f64, N>,
    jacobian: SMatrix<f64, N, N>,
    remembered: SVector<f64, N>,
    inverse: SMatrix<f64, N, N>,
    inertia: SMatrix<f64, N, N>,
    velocity_terms: SVector<f64, N>,
    jacobian_rate_velocity: SVector<f64, N>,
    desired_acceleration: SVector<f64, N>,
}

/// One step of a law.
pub fn measure(links: usize, law: Law, meter: &mut impl Meter) {
    let joints = JointCount::new(links).expect("a case has 2 to 7 links");
    for_joints!(joints, N => measure_at::<N>(law, meter));
}

fn measure_at<const N: usize>(law: Law, meter: &mut impl Meter) {
    let (laws, given) = (Laws::<N>::new(law), Given::<N>::new());
    match law {
        Law::Tj => meter.measure(|| {
            let (laws, given) = black_box((&laws, &given));
            black_box(given.torque(&laws.tj.task_force(&given.error)));
        }),
        Law::MtjSwitch | Law::MtjExponential | Law::MtjDiagonal => meter.measure(|| {
            let (laws, given) = black_box((&laws, &given));
            let answer = laws.mtj.task_force(&given.error, Some(&given.remembered), None);
            black_box(given.torque(&answer.force));
        }),
        Law::Tdc => {}
        Law::Mb => meter.measure(|| {
            let (laws, given) = black_box((&laws, &given));
            let dynamics = TaskDynamics::new(
                &given.inertia,
                &given.velocity_terms,
                &given.inverse,
                &given.jacobian_rate_velocity,
            );
            let force = laws.mb.task_force(&given.error, &given.desired_acceleration, &dynamics);
            black_box(given.torque(&force));
        }),
    }
}

impl<const N: usize> Laws<N> {
    fn new(law: Law) -> Self {
        let (kp, kd) = (Gains::Full(full(30.0)), Gains::Full(full(60.0)));
        let kind = match law {
            Law::MtjSwitch => FactorKind::Switch,
            Law::MtjDiagonal => FactorKind::Diagonal,
            Law::Tj | Law::MtjExponential | Law::Mb | Law::Tdc => FactorKind::Exponential,
        };
        let thresholds = match kind {
            FactorKind::Diagonal => Thresholds::Each(SVector::repeat(10.0), SVector::repeat(100.0)),
            _ => Thresholds::Same(10.0, 100.0),
        };
        let factor = Factor { kind, thresholds, ceiling: None };
        let tj = TransposeJacobian { kp, kd };
        Self {
            tj,
            mtj: ModifiedTransposeJacobian { tj, factor, acceleration: None },
            mb: ModelBased { kp, kd },
        }
    }
}

impl<const N: usize> Given<N> {
    fn new() -> Self {
        Self {
            error: TrackingError { position: vector(0.01), velocity: vector(0.02) },
            jacobian: full(0.7),
            remembered: vector(5.0),
            inverse: full(0.9),
            inertia: full(4.0),
            velocity_terms: vector(0.4),
            jacobian_rate_velocity: vector(0.3),
            desired_acceleration: vector(0.5),
        }
    }

    fn torque(&self, force: &SVector<f64, N>) -> SVector<f64, N> {
        matrix::transpose_times(&self.jacobian, force)
    }
}

fn vector<const N: usize>(seed: f64) -> SVector<f64, N> {
    SVector::from_fn(|i, _| seed + 0.1 * i as f64)
}

fn full<const N: usize>(seed: f64) -> SMatrix<f64, N, N> {
    SMatrix::from_fn(|i, j| seed + 0.3 * i as f64 - 0.2 * j as f64)
}
