//! Modified transpose Jacobian control.

use mtj_model::scalar::Scalar;
use nalgebra::SVector;

use super::{Factor, Regulation, TrackingError, TransposeJacobian};

/// Q̂ = K_p e + K_d ė + h with h = k · memory, eqs. (13) and (16).
///
/// The memory is a task force of a moment ago, which is about what the arm's dynamics need now; so
/// K_p e + K_d ė ≈ 0, eq. (17), and the error decays with the time constant K_d/K_p, without a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModifiedTransposeJacobian<T, const M: usize> {
    /// The part that does not remember.
    pub tj: TransposeJacobian<T, M>,
    /// How much of the memory to trust.
    pub factor: Factor<T, M>,
    /// The most of it to trust, if that is not all, as it is in the paper.
    pub ceiling: Option<T>,
}

/// A task force and what the memory had to do with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remembered<T, const M: usize> {
    /// Q̂, N.
    pub force: SVector<T, M>,
    /// h, N.
    pub memory: SVector<T, M>,
    /// k.
    pub factor: Regulation<T, M>,
}

impl<T: Scalar, const M: usize> ModifiedTransposeJacobian<T, M> {
    /// Q̂ from the tracking error and the remembered task force; `None` at the first step, where
    /// k = 0. `acceleration`, if given, is the term ë that eq. (11) adds, m/s² on a unit mass.
    // A step is so short that passing its vectors through memory would be half of what mtj costs over tj.
    #[inline(always)]
    pub fn task_force(
        &self,
        error: &TrackingError<T, M>,
        remembered: Option<&SVector<T, M>>,
        acceleration: Option<&SVector<T, M>>,
    ) -> Remembered<T, M> {
        let mut force = self.tj.task_force(error);
        if let Some(acceleration) = acceleration {
            force += acceleration;
        }
        let Some(remembered) = remembered else {
            return Remembered { force, memory: SVector::zeros(), factor: Regulation::Nothing };
        };
        let factor = self.factor.regulate(error);
        let factor = self.ceiling.map_or(factor, |ceiling| factor.under(ceiling));
        let memory = factor.times(remembered);
        Remembered { force: force + memory, memory, factor }
    }
}
