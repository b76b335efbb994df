//! A number that is a vector of the machine.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use num_traits::{One, Zero};

use super::vector::{ROUNDING, Vector};

/// A vector with the operators of a number.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub(crate) struct Wide<V>(pub(crate) V);

impl<V: Vector> Wide<V> {
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self(V::splat(value))
    }

    /// 2ⁿ for whole n from −1022 to 1023.
    #[inline(always)]
    pub(super) fn power_of_two(self) -> Self {
        Self(self.0.power_of_two())
    }

    /// The nearest whole number, for magnitudes below 2⁵¹.
    #[inline(always)]
    pub(crate) fn round(self) -> Self {
        let rounding = Self::splat(ROUNDING);
        (self + rounding) - rounding
    }
}

macro_rules! implement_operator {
    ($($operator:ident $method:ident $assign:ident $assign_method:ident;)*) => {$(
        impl<V: Vector> $operator for Wide<V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }

        impl<V: Vector> $assign for Wide<V> {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = Self(self.0.$method(other.0));
            }
        }
    )*};
}

implement_operator! {
    Add add AddAssign add_assign;
    Sub sub SubAssign sub_assign;
    Mul mul MulAssign mul_assign;
    Div div DivAssign div_assign;
}

impl<V: Vector> Neg for Wide<V> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.neg())
    }
}

impl<V: Vector> PartialEq for Wide<V> {
    #[inline(always)]
    fn eq(&self, other: &Self) -> bool {
        (0..V::COUNT).all(|lane| self.0.get(lane) == other.0.get(lane))
    }
}

impl<V: Vector> Zero for Wide<V> {
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    #[inline(always)]
    fn is_zero(&self) -> bool {
        *self == Self::zero()
    }
}

impl<V: Vector> One for Wide<V> {
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
}
