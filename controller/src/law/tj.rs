//! Transpose Jacobian control.

use mtj_model::{gains::Gains, scalar::Scalar};
use nalgebra::SVector;

use super::TrackingError;

/// Q̂ = K_p e + K_d ė, eq. (7): springs and dampers between the tip and the desired motion.
///
/// Needs no model and no inverse; works for any Jacobian. Kₚ in N/m, K_d in N s/m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransposeJacobian<T, const M: usize> {
    /// K_p.
    pub kp: Gains<T, M>,
    /// K_d.
    pub kd: Gains<T, M>,
}

impl<T: Scalar, const M: usize> TransposeJacobian<T, M> {
    /// Q̂, N.
    #[inline(always)]
    pub fn task_force(&self, error: &TrackingError<T, M>) -> SVector<T, M> {
        self.kp.times(&error.position) + self.kd.times(&error.velocity)
    }
}
