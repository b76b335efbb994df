//! A mass that is its own tip: the arm of theory.

use nalgebra::{SMatrix, SVector};

use super::{Arm, Kinematics};
use crate::scalar::Scalar;

/// The same mass on `M` axes, each moved by a joint of its own: x = q, J = 1, H = m, C = 0.
///
/// It is what an arm looks like from the tip for small errors, with m an eigenvalue of Ĥ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMass<T> {
    /// m, kg.
    pub mass: T,
}

impl<T: Scalar, const M: usize> Arm<T, M> for PointMass<T> {
    /// Position and velocity.
    type Configuration = [SVector<T, M>; 2];

    fn configuration(q: &SVector<T, M>, q_dot: &SVector<T, M>) -> Self::Configuration {
        [*q, *q_dot]
    }

    fn combine(
        one: &Self::Configuration,
        other: &Self::Configuration,
        choose: impl Fn(T, T) -> T,
    ) -> Self::Configuration {
        std::array::from_fn(|i| one[i].zip_map(&other[i], &choose))
    }

    fn inertia(&self, _: &Self::Configuration) -> SMatrix<T, M, M> {
        SMatrix::from_diagonal_element(self.mass)
    }

    fn velocity_terms(&self, _: &Self::Configuration) -> SVector<T, M> {
        SVector::zeros()
    }

    fn acceleration(&self, _: &Self::Configuration, torque: &SVector<T, M>) -> SVector<T, M> {
        torque / self.mass
    }
}

impl<T: Scalar, const M: usize> Kinematics<T, M, M> for PointMass<T> {
    type Point = SVector<T, M>;

    fn tip(&self, [position, _]: &[SVector<T, M>; 2]) -> SVector<T, M> {
        *position
    }

    fn tip_velocity(&self, [_, velocity]: &[SVector<T, M>; 2]) -> SVector<T, M> {
        *velocity
    }

    fn jacobian(&self, _: &[SVector<T, M>; 2]) -> SMatrix<T, M, M> {
        SMatrix::from_diagonal_element(T::one())
    }

    fn jacobian_rate_velocity(&self, _: &[SVector<T, M>; 2]) -> SVector<T, M> {
        SVector::zeros()
    }
}
