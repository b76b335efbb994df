//! The number type of the model and of the laws.

mod elementary;
mod vector;
mod wide;

use std::ops::Neg;

use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign, SVector};
use num_traits::{One, Zero};

pub(crate) use self::{vector::Vector, wide::Wide};

/// A real number: what the arm, the trajectory and the laws compute with.
///
/// Deliberately smaller than `nalgebra::RealField`, so that a number which counts its own
/// operations, or one that holds several lanes, can implement it in a page.
pub trait Scalar:
    nalgebra::Scalar
    + Copy
    + Zero
    + One
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
    + Neg<Output = Self>
{
    /// The nearest value to a constant.
    fn constant(value: f64) -> Self;
    /// Sine and cosine of an angle in radians.
    fn sin_cos(self) -> (Self, Self);
    /// The square root.
    fn sqrt(self) -> Self;
    /// The exponential.
    fn exp(self) -> Self;
    /// The exponential of each entry.
    fn exp_each<const M: usize>(entries: &SVector<Self, M>) -> SVector<Self, M> {
        entries.map(Self::exp)
    }
    /// The magnitude.
    fn abs(self) -> Self;
    /// What `look_up` says of the number; in lanes, of each for itself. For what no formula gives, like
    /// a table.
    fn look_up<const K: usize>(self, look_up: impl Fn(f64) -> [f64; K]) -> [Self; K];
    /// `then` where `self < bound`, else `otherwise`; the latter also where one of the two is no
    /// number.
    ///
    /// All comparisons of the laws and the trajectories are made so, because several lanes may
    /// differ in the outcome. It is no arithmetic operation.
    fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self;
}

macro_rules! implement_for_float {
    ($float:ident $($exp_each:item)?) => {
        impl Scalar for $float {
            fn constant(value: f64) -> Self {
                value as $float
            }
            fn sin_cos(self) -> (Self, Self) {
                $float::sin_cos(self)
            }
            fn sqrt(self) -> Self {
                $float::sqrt(self)
            }
            fn exp(self) -> Self {
                $float::exp(self)
            }
            $($exp_each)?
            fn abs(self) -> Self {
                $float::abs(self)
            }
            fn look_up<const K: usize>(self, look_up: impl Fn(f64) -> [f64; K]) -> [Self; K] {
                look_up(f64::from(self)).map(Self::constant)
            }
            fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
                if self < bound { then } else { otherwise }
            }
        }
    };
}

implement_for_float!(f32);
implement_for_float! {
    f64
    // All at once, they cost less than two that are had one by one.
    #[inline(always)]
    fn exp_each<const M: usize>(entries: &SVector<Self, M>) -> SVector<Self, M> {
        let Wide(powers) = elementary::exp(Wide(<[f64; M]>::from(*entries)));
        powers.into()
    }
}
