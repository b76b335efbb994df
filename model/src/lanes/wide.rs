//! A number that is a vector of the machine.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use num_traits::{One, Zero};

use super::{
    Lanes, elementary,
    vector::{ROUNDING, Vector},
};
use crate::scalar::Scalar;

/// A vector as a [`Scalar`].
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Wide<V>(V);

impl<V: Vector> Wide<V> {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(V::splat(value))
    }

    /// 2ⁿ for whole n from −1022 to 1023.
    #[inline(always)]
    pub fn power_of_two(self) -> Self {
        Self(self.0.power_of_two())
    }

    /// The nearest whole number, for magnitudes below 2⁵¹.
    #[inline(always)]
    pub fn round(self) -> Self {
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
        (0..Self::COUNT).all(|lane| self.get(lane) == other.get(lane))
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

impl<V: Vector> Scalar for Wide<V> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        elementary::sin_cos(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        elementary::exp(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
        Self(self.0.where_below(bound.0, then.0, otherwise.0))
    }
}

impl<V: Vector> Lanes for Wide<V> {
    const COUNT: usize = V::COUNT;
    #[inline(always)]
    fn get(&self, lane: usize) -> f64 {
        self.0.get(lane)
    }
    #[inline(always)]
    fn set(&mut self, lane: usize, value: f64) {
        self.0.set(lane, value);
    }
    #[inline(always)]
    fn is_any_below(self, bound: Self) -> bool {
        self.0.is_any_below(bound.0)
    }
    #[inline(always)]
    fn ceil(self) -> Self {
        let nearest = self.round();
        nearest.where_below(self, nearest + Self::one(), nearest)
    }
}
