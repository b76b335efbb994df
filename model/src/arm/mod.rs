//! Arms: kinematics and rigid-body dynamics of a chain of joints.
//!
//! An arm of `N` joints is an [`Arm`]; what its tip does in a task with `M` axes is its
//! [`Kinematics`]. Both compute from a configuration, which holds what is expensive, the sines and
//! cosines, once. To add an arm that scenarios can name, write a file like [`planar`] and name it
//! in `scenario::ArmSettings`.
//!
//! # An arm of one's own
//!
//! Laws, responders and lanes are generic over these traits. A carriage on a rail with a mast that
//! lifts the tip, its two joints sliding along x and y: x = q, J = 1, H = diag(m + M, m), C = (0, m
//! g).
//!
//! ```
//! use mtj_model::arm::{Arm, Kinematics};
//! use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
//!
//! #[derive(Clone, Copy)]
//! struct Gantry {
//!     /// M, kg.
//!     carriage: f64,
//!     /// m, kg.
//!     load: f64,
//! }
//!
//! impl Arm<f64, 2> for Gantry {
//!     /// q, m, and q̇, m/s.
//!     type Configuration = [Vector2<f64>; 2];
//!
//!     fn configuration(q: &Vector2<f64>, q_dot: &Vector2<f64>) -> Self::Configuration {
//!         [*q, *q_dot]
//!     }
//!     fn combine(
//!         one: &Self::Configuration,
//!         other: &Self::Configuration,
//!         choose: impl Fn(f64, f64) -> f64,
//!     ) -> Self::Configuration {
//!         std::array::from_fn(|i| one[i].zip_map(&other[i], &choose))
//!     }
//!     fn inertia(&self, _: &Self::Configuration) -> Matrix2<f64> {
//!         Matrix2::from_diagonal(&Vector2::new(self.load + self.carriage, self.load))
//!     }
//!     fn velocity_terms(&self, _: &Self::Configuration) -> Vector2<f64> {
//!         Vector2::new(0.0, self.load * 9.81)
//!     }
//!     fn acceleration(&self, at: &Self::Configuration, force: &Vector2<f64>) -> Vector2<f64> {
//!         (force - self.velocity_terms(at)).component_div(&self.inertia(at).diagonal())
//!     }
//! }
//!
//! impl Kinematics<f64, 2, 2> for Gantry {
//!     type Point = Vector2<f64>;
//!
//!     fn tip(&self, [q, _]: &[Vector2<f64>; 2]) -> Vector2<f64> {
//!         *q
//!     }
//!     fn tip_velocity(&self, [_, q_dot]: &[Vector2<f64>; 2]) -> SVector<f64, 2> {
//!         *q_dot
//!     }
//!     fn jacobian(&self, _: &[Vector2<f64>; 2]) -> SMatrix<f64, 2, 2> {
//!         Matrix2::identity()
//!     }
//!     fn jacobian_rate_velocity(&self, _: &[Vector2<f64>; 2]) -> SVector<f64, 2> {
//!         Vector2::zeros()
//!     }
//! }
//!
//! let gantry = Gantry { carriage: 4.0, load: 1.0 };
//! let at = Gantry::configuration(&Vector2::new(0.5, 1.0), &Vector2::new(0.1, 0.0));
//! let force = Vector2::new(2.0, 9.81);
//! let q_ddot = gantry.acceleration(&at, &force);
//! assert!((gantry.inertia(&at) * q_ddot + gantry.velocity_terms(&at) - force).norm() < 1e-12);
//! assert_eq!(gantry.jacobian(&at) * at[1], gantry.tip_velocity(&at));
//! ```

pub mod friction;
pub mod planar;
pub mod point_mass;
pub mod wall;

use nalgebra::{SMatrix, SVector};

use crate::{MAX_JOINTS, matrix, scalar::Scalar, task::Task};

/// The most inertial parameters in which the dynamics of an arm are linear.
pub const PARAMETERS: usize = 2 * MAX_JOINTS;

/// Rigid-body dynamics, eq. (1): H q̈ + C = τ.
pub trait Arm<T: Scalar, const N: usize>: Copy {
    /// What follows from q and q̇ whatever the arm's lengths and masses.
    type Configuration: Copy;

    /// The configuration at joint positions `q`, rad, and joint velocities `q_dot`, rad/s.
    fn configuration(q: &SVector<T, N>, q_dot: &SVector<T, N>) -> Self::Configuration;
    /// The configuration at the joint positions of another one, `q`, with other joint velocities.
    #[inline(always)]
    fn turning(
        _at: &Self::Configuration,
        q: &SVector<T, N>,
        q_dot: &SVector<T, N>,
    ) -> Self::Configuration {
        Self::configuration(q, q_dot)
    }
    /// Combines two configurations number by number with `choose`: lanes may differ in their
    /// choice.
    fn combine(
        one: &Self::Configuration,
        other: &Self::Configuration,
        choose: impl Fn(T, T) -> T,
    ) -> Self::Configuration;
    /// The inertia matrix H, kg m².
    fn inertia(&self, at: &Self::Configuration) -> SMatrix<T, N, N>;
    /// The velocity and gravity terms C, N m.
    fn velocity_terms(&self, at: &Self::Configuration) -> SVector<T, N>;
    /// The torques g(q) that hold the arm against gravity at joint positions `q`, rad; N m.
    #[inline(always)]
    fn gravity(&self, q: &SVector<T, N>) -> SVector<T, N> {
        self.velocity_terms(&Self::configuration(q, &SVector::zeros()))
    }
    /// Joint accelerations q̈ = H⁻¹ (τ − C) under joint torques τ, rad/s².
    fn acceleration(&self, at: &Self::Configuration, torque: &SVector<T, N>) -> SVector<T, N>;
    /// The inertial parameters p in which H and C are linear; zeros past the last, and for an arm
    /// that does not say them.
    #[inline(always)]
    fn parameters(&self) -> [T; PARAMETERS] {
        [T::zero(); _]
    }
    /// Y p = H q̈_r + C(q, q̇) q̇_r + g for other parameters p than the arm's own, N m. Ḣ − 2 C(q, q̇)
    /// is skew-symmetric, and C(q, q̇) q̇ + g are the [velocity terms](Self::velocity_terms). What is known
    /// and no parameter, like the inertia of rotors, counts with its own value.
    ///
    /// q̇_r are reference `velocity`s of the joints, rad/s, and q̈_r their `acceleration`s.
    #[inline(always)]
    fn regressor_times(
        &self,
        _at: &Self::Configuration,
        _velocity: &SVector<T, N>,
        _acceleration: &SVector<T, N>,
        _parameters: &[T; PARAMETERS],
    ) -> SVector<T, N> {
        SVector::zeros()
    }
    /// Yᵀ s for the same Y.
    #[inline(always)]
    fn regressor_transpose_times(
        &self,
        _at: &Self::Configuration,
        _velocity: &SVector<T, N>,
        _acceleration: &SVector<T, N>,
        _s: &SVector<T, N>,
    ) -> [T; PARAMETERS] {
        [T::zero(); _]
    }
}

/// What the tip of an arm does, seen from a task with `M` axes.
pub trait Kinematics<T: Scalar, const N: usize, const M: usize>: Arm<T, N> {
    /// Where a tip can be.
    type Point: Task<T, M>;

    /// The output variables x(q).
    fn tip(&self, at: &Self::Configuration) -> Self::Point;
    /// The output speeds J q̇, eq. (2).
    fn tip_velocity(&self, at: &Self::Configuration) -> SVector<T, M>;
    /// The Jacobian J.
    fn jacobian(&self, at: &Self::Configuration) -> SMatrix<T, M, N>;
    /// J̇ q̇: the tip's acceleration when no joint accelerates.
    fn jacobian_rate_velocity(&self, at: &Self::Configuration) -> SVector<T, M>;
}

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

/// J H⁻¹ Jᵀ, 1/kg: the acceleration of the tip for each unit of force at it. Its inverse is the
/// task inertia Ĥ, which so exists for redundant arms too.
#[inline(always)]
pub fn mobility<T: Scalar, const N: usize, const M: usize>(
    inertia: &SMatrix<T, N, N>,
    jacobian: &SMatrix<T, M, N>,
) -> SMatrix<T, M, M> {
    let mut mobility = SMatrix::zeros();
    for j in 0..M {
        let row = SVector::<T, N>::from_fn(|i, _| jacobian[(j, i)]);
        let column = matrix::times(jacobian, &matrix::solve_positive_definite(inertia, &row));
        for i in 0..M {
            mobility[(i, j)] = column[i];
        }
    }
    mobility
}
