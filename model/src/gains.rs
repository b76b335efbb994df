//! Gains: matrices over the task axes, and numbers over the joints.

use nalgebra::{SMatrix, SVector};

use crate::{
    MAX_AXES, MAX_JOINTS, lift, matrix,
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
    /// K⁻¹, which a positive definite matrix has.
    pub fn inverse(&self) -> Self {
        match self {
            Self::Diagonal(diagonal) => Self::Diagonal(diagonal.map(|entry| 1.0 / entry)),
            Self::Full(full) => Self::Full(full.try_inverse().unwrap_or(*full)),
        }
    }

    /// Whether xᵀ K x > 0 for every x ≠ 0, judged by the symmetric part.
    pub fn is_positive_definite(&self) -> bool {
        let full = self.matrix();
        let symmetric = (full + full.transpose()) * 0.5;
        full.iter().all(|entry| entry.is_finite())
            && nalgebra::linalg::Cholesky::new(symmetric).is_some()
    }
}

/// A gain for each joint, zero or greater: the diagonal of a matrix over the joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointGains<T> {
    /// The gains, base first; those past the last joint mean nothing.
    pub each: [T; MAX_JOINTS],
}

lift! { struct JointGains<T> { each } }

impl<T: Scalar> JointGains<T> {
    /// K x.
    #[inline(always)]
    pub fn times<const N: usize>(&self, x: &SVector<T, N>) -> SVector<T, N> {
        SVector::from_fn(|i, _| self.each[i] * x[i])
    }
}

impl JointGains<f64> {
    /// Reads a gain that is required or has a default, for so many joints.
    pub(crate) fn read(
        section: &Section<'_>,
        key: &Parameter,
        joints: usize,
    ) -> Result<Self, ScenarioError> {
        let list = section.one_or_each(key, joints)?;
        let list = list.ok_or_else(|| section.refuse(key.name(), key.expected(joints)))?;
        // What is past the last joint must not make a difference.
        let each = std::array::from_fn(|i| list.get(i).copied().unwrap_or(1.0));
        Ok(Self { each })
    }
}
