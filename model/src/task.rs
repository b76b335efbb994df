//! The arm's dynamics seen from the task.

use nalgebra::{SMatrix, SVector};

use crate::{matrix, scalar::Scalar};

/// A task, described: what of the tip is controlled.
#[derive(Debug, PartialEq)]
pub struct Description {
    /// The name in scenarios.
    pub name: &'static str,
    /// Its axes in the order of every list that has one number for each.
    pub axes: &'static [Axis],
}

/// One axis of a task.
#[derive(Debug, PartialEq)]
pub struct Axis {
    /// The name in print.
    pub name: &'static str,
    /// The unit of a position along it.
    pub unit: &'static str,
}

/// The registry of tasks.
pub const TASKS: &[Description] = &[Description {
    name: "plane",
    axes: &[Axis { name: "x", unit: "m" }, Axis { name: "y", unit: "m" }],
}];

/// Eq. (3): Ĥ ẍ + Ĉ = Q̂ for a square, non-singular Jacobian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaskDynamics<T, const N: usize> {
    /// Ĥ = J⁻ᵀ H J⁻¹: the mass that a force at the tip feels, kg.
    pub inertia: SMatrix<T, N, N>,
    /// Ĉ = J⁻ᵀ C − Ĥ J̇ q̇, N.
    ///
    /// The paper prints eq. (3b) with the dot on Ĥ instead of on J; this is what follows from
    /// substituting q̈ = J⁻¹ (ẍ − J̇ q̇) into eq. (1).
    pub velocity_terms: SVector<T, N>,
}

impl<T: Scalar, const N: usize> TaskDynamics<T, N> {
    /// From the joint-space terms H and C, the inverse Jacobian and J̇ q̇.
    #[inline(always)]
    pub fn new(
        inertia: &SMatrix<T, N, N>,
        velocity_terms: &SVector<T, N>,
        jacobian_inverse: &SMatrix<T, N, N>,
        jacobian_rate_velocity: &SVector<T, N>,
    ) -> Self {
        let task_inertia = matrix::transpose_product(
            jacobian_inverse,
            &matrix::product(inertia, jacobian_inverse),
        );
        Self {
            inertia: task_inertia,
            velocity_terms: matrix::transpose_times(jacobian_inverse, velocity_terms)
                - matrix::times(&task_inertia, jacobian_rate_velocity),
        }
    }
}
