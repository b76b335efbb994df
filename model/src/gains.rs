//! The gain matrices K_p and K_d.

use nalgebra::{SMatrix, SVector};

use crate::{matrix, scalar::Scalar};

/// A positive definite gain matrix over `M` task axes.
///
/// K_p is in N/m for tj and mtj and in 1/s² for mb; K_d in N s/m and 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gains<T, const M: usize> {
    /// Only the diagonal is not zero.
    Diagonal(SVector<T, M>),
    /// A full matrix.
    Full(SMatrix<T, M, M>),
}

impl<T: Scalar, const M: usize> Gains<T, M> {
    /// K x.
    #[inline(always)]
    pub fn times(&self, x: &SVector<T, M>) -> SVector<T, M> {
        match self {
            Self::Diagonal(diagonal) => diagonal.component_mul(x),
            Self::Full(full) => matrix::times(full, x),
        }
    }

    /// The full matrix.
    pub fn matrix(&self) -> SMatrix<T, M, M> {
        match self {
            Self::Diagonal(diagonal) => SMatrix::from_diagonal(diagonal),
            Self::Full(full) => *full,
        }
    }
}

impl<const M: usize> Gains<f64, M> {
    /// Whether xᵀ K x > 0 for every x ≠ 0, judged by the symmetric part.
    pub fn is_positive_definite(&self) -> bool {
        let full = self.matrix();
        let symmetric = (full + full.transpose()) * 0.5;
        full.iter().all(|entry| entry.is_finite())
            && nalgebra::linalg::Cholesky::new(symmetric).is_some()
    }
}
