//! A number that counts the operations it takes part in.

use std::{
    cell::Cell,
    ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign},
};

use mtj_model::scalar::Scalar;
use num_traits::{One, Zero};
use serde::Serialize;

/// How often each operation was done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub(crate) struct Operations {
    /// Products.
    pub multiplications: u64,
    /// Quotients.
    pub divisions: u64,
    /// Sums and differences; a change of sign is free.
    pub additions: u64,
    /// Square roots, exponentials, sines and cosines.
    pub functions: u64,
}

impl Add for Operations {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self {
            multiplications: self.multiplications + other.multiplications,
            divisions: self.divisions + other.divisions,
            additions: self.additions + other.additions,
            functions: self.functions + other.functions,
        }
    }
}

thread_local! {
    static DONE: Cell<Operations> = const {
        Cell::new(Operations { multiplications: 0, divisions: 0, additions: 0, functions: 0 })
    };
}

/// The result of `work` and the operations that [`Counted`] numbers did in it, on this thread.
pub(crate) fn count<R>(work: impl FnOnce() -> R) -> (R, Operations) {
    let before = DONE.replace(Operations::default());
    let result = work();
    let done = DONE.get();
    DONE.set(before + done);
    (result, done)
}

fn note(change: impl FnOnce(&mut Operations)) {
    let mut done = DONE.get();
    change(&mut done);
    DONE.set(done);
}

/// A number whose every operation is counted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Counted(pub f64);

macro_rules! implement_operator {
    ($($operator:ident $method:ident $assign:ident $assign_method:ident $counter:ident;)*) => {$(
        impl $operator for Counted {
            type Output = Self;
            fn $method(self, other: Self) -> Self {
                note(|done| done.$counter += 1);
                Self(self.0.$method(other.0))
            }
        }

        impl $assign for Counted {
            fn $assign_method(&mut self, other: Self) {
                *self = self.$method(other);
            }
        }
    )*};
}

implement_operator! {
    Add add AddAssign add_assign additions;
    Sub sub SubAssign sub_assign additions;
    Mul mul MulAssign mul_assign multiplications;
    Div div DivAssign div_assign divisions;
}

impl Neg for Counted {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Zero for Counted {
    fn zero() -> Self {
        Self(0.0)
    }
    fn is_zero(&self) -> bool {
        self.0 == 0.0
    }
}

impl One for Counted {
    fn one() -> Self {
        Self(1.0)
    }
}

impl Scalar for Counted {
    fn constant(value: f64) -> Self {
        Self(value)
    }
    fn sin_cos(self) -> (Self, Self) {
        note(|done| done.functions += 2);
        let (sin, cos) = self.0.sin_cos();
        (Self(sin), Self(cos))
    }
    fn look_up<const K: usize>(self, look_up: impl Fn(f64) -> [f64; K]) -> [Self; K] {
        note(|done| done.functions += K as u64);
        look_up(self.0).map(Self)
    }
    fn sqrt(self) -> Self {
        note(|done| done.functions += 1);
        Self(self.0.sqrt())
    }
    fn exp(self) -> Self {
        note(|done| done.functions += 1);
        Self(self.0.exp())
    }
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
        if self.0 < bound.0 { then } else { otherwise }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_operation_is_counted_once_and_a_change_of_sign_is_free() {
        let (result, done) = count(|| {
            let mut x = Counted(9.0).sqrt() * Counted(2.0) - Counted(1.0);
            x += Counted(4.0);
            -x / Counted(3.0)
        });
        assert_eq!(result, Counted(-3.0));
        let expected = Operations { multiplications: 1, divisions: 1, additions: 2, functions: 1 };
        assert_eq!(done, expected);
    }

    #[test]
    fn a_count_inside_a_count_belongs_to_both() {
        let (inner, outer) = count(|| {
            let _ = Counted(1.0) + Counted(1.0);
            count(|| Counted(1.0) + Counted(1.0)).1
        });
        assert_eq!((inner.additions, outer.additions), (1, 2));
    }
}
