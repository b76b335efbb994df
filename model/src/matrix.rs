//! Products and factorisations of static matrices.
//!
//! nalgebra's own product computes α A x + β y and so multiplies by one and adds to zero. Here a
//! row of length n costs n multiplications and n − 1 additions, which is what an operation count
//! of a control law (the paper's Table 1) means, and the work runs on any [`Scalar`].

use nalgebra::{SMatrix, SVector};

use crate::scalar::Scalar;

/// The first entries of a list, with zeros after them where it is shorter.
#[inline(always)]
pub fn padded<T: Scalar, const N: usize>(list: &[T]) -> [T; N] {
    let mut padded = [T::zero(); N];
    for (to, from) in padded.iter_mut().zip(list) {
        *to = *from;
    }
    padded
}

/// A x.
#[inline(always)]
pub fn times<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    x: &SVector<T, C>,
) -> SVector<T, R> {
    SVector::from_fn(|i, _| sum_of(C, |j| a[(i, j)] * x[j]))
}

/// Aᵀ x.
#[inline(always)]
pub fn transpose_times<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    x: &SVector<T, R>,
) -> SVector<T, C> {
    SVector::from_fn(|j, _| sum_of(R, |i| a[(i, j)] * x[i]))
}

/// Aᵀ B.
#[inline(always)]
pub fn transpose_product<T: Scalar, const R: usize, const C: usize, const K: usize>(
    a: &SMatrix<T, R, C>,
    b: &SMatrix<T, R, K>,
) -> SMatrix<T, C, K> {
    SMatrix::from_fn(|i, j| sum_of(R, |k| a[(k, i)] * b[(k, j)]))
}

/// A B.
#[inline(always)]
pub fn product<T: Scalar, const R: usize, const C: usize, const K: usize>(
    a: &SMatrix<T, R, C>,
    b: &SMatrix<T, C, K>,
) -> SMatrix<T, R, K> {
    SMatrix::from_fn(|i, j| sum_of(C, |k| a[(i, k)] * b[(k, j)]))
}

/// ‖x‖.
#[inline(always)]
pub fn norm<T: Scalar, const R: usize>(x: &SVector<T, R>) -> T {
    squared_norm(x).sqrt()
}

/// ‖x‖².
#[inline(always)]
pub fn squared_norm<T: Scalar, const R: usize>(x: &SVector<T, R>) -> T {
    sum_of(R, |i| x[i] * x[i])
}

/// ‖A‖, the root of the sum of all squares.
#[inline(always)]
pub fn size<T: Scalar, const R: usize, const C: usize>(a: &SMatrix<T, R, C>) -> T {
    sum_of(C, |j| sum_of(R, |i| a[(i, j)] * a[(i, j)])).sqrt()
}

/// A⁻¹ of a matrix of two rows; not finite where there is none, and for other matrices.
#[inline(always)]
pub fn inverse<T: Scalar, const M: usize>(a: &SMatrix<T, M, M>) -> SMatrix<T, M, M> {
    if M != 2 {
        return SMatrix::repeat(T::constant(f64::NAN));
    }
    let determinant = a[(0, 0)] * a[(1, 1)] - a[(1, 0)] * a[(0, 1)];
    let mut inverse = SMatrix::zeros();
    inverse[(0, 0)] = a[(1, 1)] / determinant;
    inverse[(0, 1)] = -a[(0, 1)] / determinant;
    inverse[(1, 0)] = -a[(1, 0)] / determinant;
    inverse[(1, 1)] = a[(0, 0)] / determinant;
    inverse
}

/// |A| |A⁻¹| up to which a matrix A that a law inverts is inverted as it is.
const WELL_CONDITIONED: f64 = 50.0;

/// A⁻¹, or near a singular A its damped least squares: (Aᵀ A + λ² 1)⁻¹ Aᵀ, which is bounded and
/// continuous in A. Also returns the damping, 0 where there is none, to 1 where A is singular.
///
/// λ² = (|A| / 50)² (1 − (50 / κ)²) for a condition κ = |A| |A⁻¹| beyond 50.
#[inline(always)]
pub fn damped_inverse<T: Scalar, const M: usize>(a: &SMatrix<T, M, M>) -> (SMatrix<T, M, M>, T) {
    let exact = inverse(a);
    let (size_of_a, limit) = (size(a), T::constant(WELL_CONDITIONED));
    let (is_well, damping) = damping(size_of_a * size(&exact), limit);
    let scale = size_of_a / limit;
    let mut normal = transpose_product(a, a);
    for i in 0..M {
        normal[(i, i)] += scale * scale * damping;
    }
    let damped = product(&positive_definite_inverse(&normal), &a.transpose());
    (exact.zip_map(&damped, |exact, damped| T::zero().where_below(is_well, exact, damped)), damping)
}

/// The same for a symmetric positive definite matrix A = B Bᵀ: (A + λ² 1)⁻¹, with the condition and
/// the size of B.
#[inline(always)]
pub fn damped_positive_definite_inverse<T: Scalar, const M: usize>(
    a: &SMatrix<T, M, M>,
) -> (SMatrix<T, M, M>, T) {
    let exact = positive_definite_inverse(a);
    let limit = T::constant(WELL_CONDITIONED * WELL_CONDITIONED);
    let (is_well, damping) = damping(size(a) * size(&exact), limit);
    let mut shifted = *a;
    for i in 0..M {
        shifted[(i, i)] += size(a) / limit * damping;
    }
    let damped = positive_definite_inverse(&shifted);
    (exact.zip_map(&damped, |exact, damped| T::zero().where_below(is_well, exact, damped)), damping)
}

/// One where a condition is below its limit, else zero; and how strongly to damp, 0 to 1. A
/// condition that is no number counts as infinite.
#[inline(always)]
fn damping<T: Scalar>(condition: T, limit: T) -> (T, T) {
    let (zero, one) = (T::zero(), T::one());
    let is_well = condition.where_below(limit, one, zero);
    let ratio = condition.where_below(T::constant(f64::MAX), limit / condition, zero);
    (is_well, condition.where_below(limit, zero, one - ratio * ratio))
}

/// Solves A x = b for a symmetric positive definite A by the factorisation A = L D Lᵀ, which needs
/// no square roots.
///
/// No pivoting, hence no branches: a pivot that is not positive, which a mass matrix never has,
/// shows as a solution that is not finite or far off.
#[inline(always)]
pub fn solve_positive_definite<T: Scalar, const N: usize>(
    a: &SMatrix<T, N, N>,
    b: &SVector<T, N>,
) -> SVector<T, N> {
    // Row i of L, left of the diagonal of ones, and of L D; and 1/D.
    let mut unit = SMatrix::<T, N, N>::zeros();
    let mut scaled = SMatrix::<T, N, N>::zeros();
    let mut inverse = SVector::<T, N>::zeros();
    let mut x = *b;
    for i in 0..N {
        let mut pivot = a[(i, i)];
        for j in 0..i {
            let mut entry = a[(i, j)];
            for k in 0..j {
                entry -= scaled[(i, k)] * unit[(j, k)];
            }
            scaled[(i, j)] = entry;
            unit[(i, j)] = entry * inverse[j];
            pivot -= unit[(i, j)] * entry;
            let above = x[j];
            x[i] -= unit[(i, j)] * above;
        }
        inverse[i] = T::one() / pivot;
    }
    for i in (0..N).rev() {
        x[i] *= inverse[i];
        for k in i + 1..N {
            let below = x[k];
            x[i] -= unit[(k, i)] * below;
        }
    }
    x
}

/// A⁻¹ of a symmetric positive definite A, column by column.
#[inline(always)]
pub fn positive_definite_inverse<T: Scalar, const N: usize>(
    a: &SMatrix<T, N, N>,
) -> SMatrix<T, N, N> {
    let mut inverse = SMatrix::zeros();
    for j in 0..N {
        let mut unit = SVector::<T, N>::zeros();
        unit[j] = T::one();
        let column = solve_positive_definite(a, &unit);
        for i in 0..N {
            inverse[(i, j)] = column[i];
        }
    }
    inverse
}

/// term(0) + term(1) + …, with one addition fewer than there are terms.
#[inline(always)]
fn sum_of<T: Scalar>(count: usize, term: impl Fn(usize) -> T) -> T {
    if count == 0 {
        return T::zero();
    }
    let mut sum = term(0);
    for i in 1..count {
        sum += term(i);
    }
    sum
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

    use super::*;

    #[test]
    fn products_agree_with_nalgebra() {
        let a = Matrix2x3::new(1.0, -2.0, 3.0, 0.5, 4.0, -1.0);
        let x = Vector3::new(0.3, -0.7, 2.0);
        let y = Vector2::new(1.5, -2.5);
        let b = Matrix3::new(2.0, 0.1, 0.2, 0.1, 3.0, 0.3, 0.2, 0.3, 4.0);
        assert!((times(&a, &x) - a * x).norm() < 1e-15);
        assert!((transpose_times(&a, &y) - a.transpose() * y).norm() < 1e-15);
        assert!((product(&a, &b) - a * b).norm() < 1e-14);
        assert!((transpose_product(&a, &a) - a.transpose() * a).norm() < 1e-14);
        assert!(f64::abs(norm(&x) - x.norm()) < 1e-15);
    }

    #[test]
    fn an_inverse_undoes_its_matrix_and_is_not_finite_where_there_is_none() {
        let a = nalgebra::Matrix2::new(2.0, -1.0, 0.5, 3.0);
        assert!((product(&a, &inverse(&a)) - nalgebra::Matrix2::identity()).norm() < 1e-15);
        assert!(f64::abs(size(&a) - a.norm()) < 1e-15);
        let singular = nalgebra::Matrix2::new(1.0, 2.0, 2.0, 4.0);
        assert!(!f64::is_finite(size(&inverse(&singular))));
    }

    #[test]
    fn a_damped_inverse_is_exact_where_the_matrix_is_well_conditioned_and_bounded_elsewhere() {
        let leaning = |height: f64| nalgebra::Matrix2::new(1.0, 1.0, 0.5, 0.5 + height);
        let mut before: Option<nalgebra::Matrix2<f64>> = None;
        for step in 0..4000 {
            let a = leaning(f64::from(2000 - step) * 1e-4);
            let (found, damping) = damped_inverse(&a);
            let condition = a.norm() * inverse(&a).norm();
            if condition < WELL_CONDITIONED {
                assert_eq!((found, damping), (inverse(&a), 0.0));
            } else {
                assert!(damping > 0.0 && damping <= 1.0, "{damping}");
            }
            assert!(found.norm() < 2.0 * WELL_CONDITIONED / a.norm(), "{found}");
            if let Some(before) = before {
                assert!((found - before).norm() < 0.05 * WELL_CONDITIONED, "a jump at {a}");
            }
            before = Some(found);
            let (square, damping) = damped_positive_definite_inverse(&(a * a.transpose()));
            assert!(square.iter().all(|entry| entry.is_finite()), "{square}");
            assert!((0.0..=1.0).contains(&damping));
        }
        // At a singular matrix that is what the singular value decomposition gives.
        let a = leaning(0.0);
        let svd = a.svd(true, true);
        let lambda = a.norm() / WELL_CONDITIONED;
        let damped = svd.singular_values.map(|s| s / (s * s + lambda * lambda));
        let expected = svd.v_t.unwrap().transpose()
            * nalgebra::Matrix2::from_diagonal(&damped)
            * svd.u.unwrap().transpose();
        assert!((damped_inverse(&a).0 - expected).norm() < 1e-9);
    }

    #[test]
    fn a_positive_definite_system_is_solved() {
        let a = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
        let x = Vector3::new(1.0, -2.0, 0.5);
        assert!((solve_positive_definite(&a, &(a * x)) - x).norm() < 1e-14);
    }
}
