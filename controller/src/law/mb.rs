//! Model-based control, or computed torque.

use mtj_model::{gains::Gains, scalar::Scalar, task::TaskDynamics};
use nalgebra::SVector;

use super::TrackingError;

/// Q̂ = Ĥ (K_p e + K_d ė + a_des) + Ĉ, eq. (4), which makes the error obey eq. (5):
/// ë + K_d ė + K_p e = 0, if the model is exact. K_p in 1/s², K_d in 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModelBased<T, const N: usize> {
    /// K_p.
    pub kp: Gains<T, N>,
    /// K_d.
    pub kd: Gains<T, N>,
}

impl<T: Scalar, const N: usize> ModelBased<T, N> {
    /// Q̂, N, from the tracking error, the desired acceleration and the model's Ĥ and Ĉ.
    #[inline(always)]
    pub fn task_force(
        &self,
        error: &TrackingError<T, N>,
        desired_acceleration: &SVector<T, N>,
        dynamics: &TaskDynamics<T, N>,
    ) -> SVector<T, N> {
        let acceleration =
            self.kp.times(&error.position) + self.kd.times(&error.velocity) + desired_acceleration;
        mtj_model::matrix::times(&dynamics.inertia, &acceleration) + dynamics.velocity_terms
    }
}
