//! The regulating factor k: how much of the memory to trust.

use mtj_model::{matrix, scalar::Scalar, scenario::FactorKind};
use nalgebra::SVector;

use super::TrackingError;

/// How k follows from the tracking error. Thresholds are positive, in m and m/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Factor<T, const M: usize> {
    /// Eq. (14): 1 while ‖e‖ < ε and ‖ė‖ < ε̇, else 0.
    Switch {
        /// ε.
        error: T,
        /// ε̇.
        error_rate: T,
    },
    /// Eq. (15a): exp(−(‖e‖/e_max + ‖ė‖/ė_max)).
    Exponential {
        /// e_max.
        error: T,
        /// ė_max.
        error_rate: T,
    },
    /// Eq. (15b): kᵢᵢ = exp(−(|eᵢ|/e_maxᵢ + |ėᵢ|/ė_maxᵢ)).
    Diagonal {
        /// e_max of each axis.
        error: SVector<T, M>,
        /// ė_max of each axis.
        error_rate: SVector<T, M>,
    },
}

/// A regulating factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Regulation<T, const M: usize> {
    /// Use none of the memory: k = 0, plain tj.
    Nothing,
    /// k of one or zero: use the memory as it is, or none of it, without a multiplication.
    Switch(T),
    /// k on each axis: the diagonal of K.
    Each(SVector<T, M>),
}

impl<T: Scalar, const M: usize> Factor<T, M> {
    /// The factor of a kind, with thresholds for each axis; where one will do, it is the first.
    pub fn new(kind: FactorKind, error: SVector<T, M>, error_rate: SVector<T, M>) -> Self {
        let (first, first_rate) = (error[0], error_rate[0]);
        match kind {
            FactorKind::Switch => Self::Switch { error: first, error_rate: first_rate },
            FactorKind::Exponential => Self::Exponential { error: first, error_rate: first_rate },
            FactorKind::Diagonal => Self::Diagonal { error, error_rate },
        }
    }

    /// k for a tracking error.
    #[inline(always)]
    pub fn regulate(&self, e: &TrackingError<T, M>) -> Regulation<T, M> {
        match self {
            Self::Switch { error, error_rate } => {
                let (one, zero) = (T::one(), T::zero());
                let slow = matrix::norm(&e.velocity).where_below(*error_rate, one, zero);
                Regulation::Switch(matrix::norm(&e.position).where_below(*error, slow, zero))
            }
            Self::Exponential { error, error_rate } => {
                let (size, rate) = (matrix::norm(&e.position), matrix::norm(&e.velocity));
                Regulation::Each(SVector::repeat((-(size / *error + rate / *error_rate)).exp()))
            }
            Self::Diagonal { error, error_rate } => {
                Regulation::Each(T::exp_each(&SVector::from_fn(|i, _| {
                    -(e.position[i].abs() / error[i] + e.velocity[i].abs() / error_rate[i])
                })))
            }
        }
    }
}

impl<T: Scalar, const M: usize> Regulation<T, M> {
    /// k · memory.
    #[inline(always)]
    pub fn times(&self, memory: &SVector<T, M>) -> SVector<T, M> {
        match self {
            Self::Nothing => SVector::zeros(),
            Self::Switch(k) => memory.map(|entry| T::zero().where_below(*k, entry, T::zero())),
            Self::Each(k) => k.component_mul(memory),
        }
    }

    /// c k: the same factor under a ceiling c.
    #[inline(always)]
    pub fn under(self, ceiling: T) -> Self {
        match self {
            Self::Nothing => self,
            Self::Switch(k) => Self::Each(SVector::repeat(k * ceiling)),
            Self::Each(k) => Self::Each(k * ceiling),
        }
    }

    /// k on each axis.
    #[inline(always)]
    pub fn per_axis(&self) -> SVector<T, M> {
        match self {
            Self::Nothing => SVector::zeros(),
            Self::Switch(k) => SVector::repeat(*k),
            Self::Each(k) => *k,
        }
    }
}
