//! The gain matrices K_p and K_d.

use nalgebra::{SMatrix, SVector};

use crate::{
    MAX_AXES, lift, matrix,
    scalar::Scalar,
    scenario::{
        error::ScenarioError,
        key::Parameter,
        section::{self, Section},
    },
};

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

lift! { enum Gains<T, M> { Diagonal(diagonal), Full(full) } }

impl Gains<f64, MAX_AXES> {
    /// Reads a gain over `axes` task axes. On axes that the task does not have, it is one.
    pub(crate) fn read(
        section: &Section<'_>,
        key: &Parameter,
        axes: usize,
    ) -> Result<Self, ScenarioError> {
        section.get(key, axes, |value| Self::of(value, axes))
    }

    /// The gain that a value says, if it is positive definite.
    pub(crate) fn of(value: &toml::Value, axes: usize) -> Option<Self> {
        let gains = if let Some(number) = section::number(value) {
            Self::Diagonal(SVector::repeat(number))
        } else if let Some(diagonal) = section::numbers(value, axes) {
            Self::Diagonal(SVector::from_fn(|i, _| diagonal.get(i).copied().unwrap_or(1.0)))
        } else {
            let rows = value.as_array().filter(|rows| rows.len() == axes)?;
            let rows: Vec<_> =
                rows.iter().map(|row| section::numbers(row, axes)).collect::<Option<_>>()?;
            let entry = |i: usize, j: usize| rows.get(i).and_then(|row| row.get(j)).copied();
            Self::Full(SMatrix::from_fn(|i, j| {
                entry(i, j).unwrap_or(if i == j { 1.0 } else { 0.0 })
            }))
        };
        gains.is_positive_definite().then_some(gains)
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
