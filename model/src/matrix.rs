//! Products and factorisations of static matrices.
//!
//! nalgebra's own product computes α A x + β y and so multiplies by one and adds to zero. Here a
//! row of length n costs n multiplications and n − 1 additions, which is what an operation count
//! of a control law (the paper's Table 1) means, and the work runs on any [`Scalar`].

use nalgebra::{SMatrix, SVector};

use crate::scalar::Scalar;

/// A x.
pub fn times<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    x: &SVector<T, C>,
) -> SVector<T, R> {
    SVector::from_fn(|i, _| sum_of(C, |j| a[(i, j)] * x[j]))
}

/// Aᵀ x.
pub fn transpose_times<T: Scalar, const R: usize, const C: usize>(
    a: &SMatrix<T, R, C>,
    x: &SVector<T, R>,
) -> SVector<T, C> {
    SVector::from_fn(|j, _| sum_of(R, |i| a[(i, j)] * x[i]))
}

/// Aᵀ B.
pub fn transpose_product<T: Scalar, const R: usize, const C: usize, const K: usize>(
    a: &SMatrix<T, R, C>,
    b: &SMatrix<T, R, K>,
) -> SMatrix<T, C, K> {
    SMatrix::from_fn(|i, j| sum_of(R, |k| a[(k, i)] * b[(k, j)]))
}

/// A B.
pub fn product<T: Scalar, const R: usize, const C: usize, const K: usize>(
    a: &SMatrix<T, R, C>,
    b: &SMatrix<T, C, K>,
) -> SMatrix<T, R, K> {
    SMatrix::from_fn(|i, j| sum_of(C, |k| a[(i, k)] * b[(k, j)]))
}

/// ‖x‖.
pub fn norm<T: Scalar, const R: usize>(x: &SVector<T, R>) -> T {
    sum_of(R, |i| x[i] * x[i]).sqrt()
}

/// Solves A x = b for a symmetric positive definite A by Cholesky's factorisation A = L Lᵀ.
///
/// No pivoting, hence no branches: a pivot that is not positive, which a mass matrix never has,
/// shows as a non-finite solution.
pub fn solve_positive_definite<T: Scalar, const N: usize>(
    a: &SMatrix<T, N, N>,
    b: &SVector<T, N>,
) -> SVector<T, N> {
    let mut lower = SMatrix::<T, N, N>::zeros();
    for j in 0..N {
        for i in j..N {
            let mut entry = a[(i, j)];
            for k in 0..j {
                entry -= lower[(i, k)] * lower[(j, k)];
            }
            lower[(i, j)] = if i == j { entry.sqrt() } else { entry / lower[(j, j)] };
        }
    }
    let mut x = *b;
    for i in 0..N {
        let mut entry = x[i];
        for k in 0..i {
            entry -= lower[(i, k)] * x[k];
        }
        x[i] = entry / lower[(i, i)];
    }
    for i in (0..N).rev() {
        let mut entry = x[i];
        for k in i + 1..N {
            entry -= lower[(k, i)] * x[k];
        }
        x[i] = entry / lower[(i, i)];
    }
    x
}

/// term(0) + term(1) + …, with one addition fewer than there are terms.
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
    fn a_positive_definite_system_is_solved() {
        let a = Matrix3::new(4.0, 1.0, -0.5, 1.0, 3.0, 0.7, -0.5, 0.7, 2.0);
        let x = Vector3::new(1.0, -2.0, 0.5);
        assert!((solve_positive_definite(&a, &(a * x)) - x).norm() < 1e-14);
    }
}
