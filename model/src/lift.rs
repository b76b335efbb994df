//! Lifting: the same value with another number type, also in lanes.
//!
//! Settings are read with plain numbers and for as many task axes as there can be. [`Lift`] turns
//! them into the same value with another number type and as many axes as a task has. Which fields
//! that concerns is declared once, beside the type:
//!
//! ```
//! use mtj_model::{lift, lift::Lift};
//!
//! struct Spring<T> {
//!     stiffness: T,
//!     length: T,
//! }
//! lift! { struct Spring<T> { stiffness, length } }
//!
//! let single: Spring<f32> = Spring { stiffness: 2.0, length: 0.5 }.lift::<f32, 2>();
//! assert_eq!(single.stiffness, 2.0);
//! ```

use nalgebra::{SMatrix, SVector, Vector2};

use crate::{MAX_AXES, lanes::Lanes, scalar::Scalar};

/// The choices in a value that decide which formulas are evaluated; values of one shape share
/// lanes.
pub type Shape = Vec<u8>;

/// A value of plain numbers that can be lifted to another number type.
pub trait Lift {
    /// The value with numbers `T` and `M` task axes.
    type In<T: Scalar, const M: usize>;

    /// Appends the value's shape.
    fn shape(&self, shape: &mut Shape);
    /// The same value with numbers `T`; in lanes, the same in all of them.
    fn lift<T: Scalar, const M: usize>(&self) -> Self::In<T, M>;
    /// Puts the value's numbers into one lane of a value of the same shape.
    fn put<T: Lanes, const M: usize>(&self, all: &mut Self::In<T, M>, lane: usize);
}

impl Lift for f64 {
    type In<T: Scalar, const M: usize> = T;

    fn shape(&self, _: &mut Shape) {}
    fn lift<T: Scalar, const M: usize>(&self) -> T {
        T::constant(*self)
    }
    fn put<T: Lanes, const M: usize>(&self, all: &mut T, lane: usize) {
        all.set(lane, *self);
    }
}

/// A point in the plane.
impl Lift for Vector2<f64> {
    type In<T: Scalar, const M: usize> = Vector2<T>;

    fn shape(&self, _: &mut Shape) {}
    fn lift<T: Scalar, const M: usize>(&self) -> Vector2<T> {
        self.map(T::constant)
    }
    fn put<T: Lanes, const M: usize>(&self, all: &mut Vector2<T>, lane: usize) {
        all.x.set(lane, self.x);
        all.y.set(lane, self.y);
    }
}

/// A number for each task axis: the first `M` of them.
impl Lift for SVector<f64, MAX_AXES> {
    type In<T: Scalar, const M: usize> = SVector<T, M>;

    fn shape(&self, _: &mut Shape) {}
    fn lift<T: Scalar, const M: usize>(&self) -> SVector<T, M> {
        SVector::from_fn(|i, _| T::constant(self[i]))
    }
    fn put<T: Lanes, const M: usize>(&self, all: &mut SVector<T, M>, lane: usize) {
        for (all, number) in all.iter_mut().zip(self) {
            all.set(lane, *number);
        }
    }
}

/// A matrix over the task axes: the first `M` rows and columns.
impl Lift for SMatrix<f64, MAX_AXES, MAX_AXES> {
    type In<T: Scalar, const M: usize> = SMatrix<T, M, M>;

    fn shape(&self, _: &mut Shape) {}
    fn lift<T: Scalar, const M: usize>(&self) -> SMatrix<T, M, M> {
        SMatrix::from_fn(|i, j| T::constant(self[(i, j)]))
    }
    fn put<T: Lanes, const M: usize>(&self, all: &mut SMatrix<T, M, M>, lane: usize) {
        for i in 0..M {
            for j in 0..M {
                all[(i, j)].set(lane, self[(i, j)]);
            }
        }
    }
}

impl<X: Lift, const K: usize> Lift for [X; K] {
    type In<T: Scalar, const M: usize> = [X::In<T, M>; K];

    fn shape(&self, shape: &mut Shape) {
        self.iter().for_each(|entry| entry.shape(shape));
    }
    fn lift<T: Scalar, const M: usize>(&self) -> Self::In<T, M> {
        self.each_ref().map(X::lift::<T, M>)
    }
    fn put<T: Lanes, const M: usize>(&self, all: &mut Self::In<T, M>, lane: usize) {
        for (entry, all) in self.iter().zip(all) {
            entry.put::<T, M>(all, lane);
        }
    }
}

impl<X: Lift> Lift for Option<X> {
    type In<T: Scalar, const M: usize> = Option<X::In<T, M>>;

    fn shape(&self, shape: &mut Shape) {
        shape.push(u8::from(self.is_some()));
        self.iter().for_each(|value| value.shape(shape));
    }
    fn lift<T: Scalar, const M: usize>(&self) -> Self::In<T, M> {
        self.as_ref().map(X::lift::<T, M>)
    }
    fn put<T: Lanes, const M: usize>(&self, all: &mut Self::In<T, M>, lane: usize) {
        if let (Some(value), Some(all)) = (self, all) {
            value.put::<T, M>(all, lane);
        }
    }
}

/// Declares the fields of a struct, or the variants of an enum, for [`Lift`].
///
/// The type has no parameters, a number `<T>`, a number and the task axes `<T, M>`, a number and
/// the joints `<T; N>`, or a number, an arm and the task axes `<T, A, M>`. An enum without fields
/// decides by its variants alone.
#[macro_export]
macro_rules! lift {
    (struct $name:ident<T> { $($field:ident),* $(,)? }) => {
        $crate::lift! { @struct [] $name<f64>, $name<T>; $name { $($field),* } }
    };
    (struct $name:ident<T, M> { $($field:ident),* $(,)? }) => {
        $crate::lift! { @struct [] $name<f64, { $crate::MAX_AXES }>, $name<T, M>; $name { $($field),* } }
    };
    (struct $name:ident<T; N> { $($field:ident),* $(,)? }) => {
        $crate::lift! { @struct [const N: usize] $name<f64, N>, $name<T, N>; $name { $($field),* } }
    };
    (struct $name:ident<T, A, M> { $($field:ident),* $(,)? }) => {
        $crate::lift! {
            @struct [A: $crate::lift::Lift] $name<f64, A, { $crate::MAX_AXES }>,
            $name<T, A::In<T, M>, M>; $name { $($field),* }
        }
    };
    (enum $name:ident { $($variant:ident),* $(,)? }) => {
        impl $crate::lift::Lift for $name {
            type In<T: $crate::scalar::Scalar, const M: usize> = $name;

            fn shape(&self, shape: &mut $crate::lift::Shape) {
                shape.push(*self as u8);
            }
            fn lift<T: $crate::scalar::Scalar, const M: usize>(&self) -> $name {
                *self
            }
            fn put<T: $crate::lanes::Lanes, const M: usize>(&self, _: &mut $name, _: usize) {}
        }
    };
    (enum $name:ident<T> { $($variants:tt)* }) => {
        $crate::lift! { @enum $name<f64>, $name<T>; $name { $($variants)* } }
    };
    (enum $name:ident<T, M> { $($variants:tt)* }) => {
        $crate::lift! { @enum $name<f64, { $crate::MAX_AXES }>, $name<T, M>; $name { $($variants)* } }
    };
    (@struct [$($const:tt)*] $plain:ty, $lifted:ty; $name:ident { $($field:ident),* }) => {
        impl<$($const)*> $crate::lift::Lift for $plain {
            type In<T: $crate::scalar::Scalar, const M: usize> = $lifted;

            fn shape(&self, shape: &mut $crate::lift::Shape) {
                $($crate::lift::Lift::shape(&self.$field, shape);)*
            }
            fn lift<T: $crate::scalar::Scalar, const M: usize>(&self) -> $lifted {
                $name { $($field: $crate::lift::Lift::lift::<T, M>(&self.$field)),* }
            }
            fn put<T: $crate::lanes::Lanes, const M: usize>(&self, all: &mut $lifted, lane: usize) {
                $($crate::lift::Lift::put::<T, M>(&self.$field, &mut all.$field, lane);)*
            }
        }
    };
    (@enum $plain:ty, $lifted:ty; $name:ident { $($variant:ident $(($($field:ident),*))?),* $(,)? }) => {
        impl $crate::lift::Lift for $plain {
            type In<T: $crate::scalar::Scalar, const M: usize> = $lifted;

            fn shape(&self, shape: &mut $crate::lift::Shape) {
                let mut number = 0;
                $(
                    if let Self::$variant $(($($field),*))? = self {
                        shape.push(number);
                        $($($crate::lift::Lift::shape($field, shape);)*)?
                    }
                    number += 1;
                )*
                let _ = number;
            }
            fn lift<T: $crate::scalar::Scalar, const M: usize>(&self) -> $lifted {
                match self {
                    $(Self::$variant $(($($field),*))? => $name::$variant
                        $(($($crate::lift::Lift::lift::<T, M>($field)),*))?,)*
                }
            }
            #[allow(unreachable_patterns, reason = "an enum may have one variant")]
            fn put<T: $crate::lanes::Lanes, const M: usize>(&self, all: &mut $lifted, lane: usize) {
                $(
                    #[allow(unused_parens)]
                    if let Self::$variant $(($($field),*))? = self {
                        $crate::lift! { @put $name $variant [$($($field)*)?] all, lane }
                    }
                )*
            }
        }
    };
    (@put $name:ident $variant:ident [] $all:ident, $lane:ident) => {};
    (@put $name:ident $variant:ident [$a:ident] $all:ident, $lane:ident) => {
        if let $name::$variant(all) = $all {
            $crate::lift::Lift::put::<T, M>($a, all, $lane);
        }
    };
    (@put $name:ident $variant:ident [$a:ident $b:ident] $all:ident, $lane:ident) => {
        if let $name::$variant(first, second) = $all {
            $crate::lift::Lift::put::<T, M>($a, first, $lane);
            $crate::lift::Lift::put::<T, M>($b, second, $lane);
        }
    };
}
