//! The three laws. Each turns a tracking error into a task force; the torque is always τ = Jᵀ Q̂.

mod factor;
mod mb;
mod mtj;
mod tj;

pub use factor::{Factor, Regulation};
pub use mb::ModelBased;
pub use mtj::{ModifiedTransposeJacobian, Remembered};
pub use tj::TransposeJacobian;

use nalgebra::SVector;

/// How far the tip is from where it should be: desired − actual, eq. (6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingError<T, const M: usize> {
    /// e, m.
    pub position: SVector<T, M>,
    /// ė, m/s.
    pub velocity: SVector<T, M>,
}
