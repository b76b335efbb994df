//! Several numbers at once: a [`Scalar`] with lanes, and the widest that the processor has.
//!
//! What is generic over [`Scalar`] runs on these as it is written. Each lane is computed by itself
//! with the same IEEE operations, none of them contracted, so that a lane's numbers depend neither
//! on its neighbours nor on how wide the vectors of the machine are.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64;

use num_traits::One;

use crate::scalar::{Scalar, Vector, Wide};

/// A number that holds several, each in its lane.
pub trait Lanes: Scalar {
    /// How many lanes there are.
    const COUNT: usize;
    /// The number in a lane.
    fn get(&self, lane: usize) -> f64;
    /// Puts a number into a lane.
    fn set(&mut self, lane: usize, value: f64);
    /// Whether `self < bound` in any lane.
    fn is_any_below(self, bound: Self) -> bool;
    /// The next whole number, for magnitudes below 2⁵¹.
    fn ceil(self) -> Self;
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

/// A computation in lanes.
///
/// [`Work::run`] and whatever it calls in its inner loops are to be `#[inline(always)]`: only what
/// is inlined is compiled for the vectors that were chosen.
pub trait Work {
    /// Its result.
    type Output;
    /// Computes it with numbers of one width.
    fn run<T: Lanes>(self) -> Self::Output;
}

/// The width of the vectors that lanes are computed in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Four lanes in whatever the program was compiled for.
    Plain,
    /// Four lanes.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Eight lanes.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// The widest that this machine has.
    pub fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if std::arch::is_x86_feature_detected!("avx512f") {
                return Self(Kind::Avx512);
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                return Self(Kind::Avx2);
            }
        }
        Self(Kind::Plain)
    }

    /// All widths that this machine has.
    pub fn all() -> Vec<Self> {
        let widest = Self::widest();
        let mut all = vec![Self(Kind::Plain)];
        #[cfg(target_arch = "x86_64")]
        if widest == Self(Kind::Avx512) && std::arch::is_x86_feature_detected!("avx2") {
            all.push(Self(Kind::Avx2));
        }
        if widest != all[0] {
            all.push(widest);
        }
        all
    }

    /// Runs a computation with vectors of this width.
    pub fn run<W: Work>(self, work: W) -> W::Output {
        match self.0 {
            Kind::Plain => work.run::<Wide<[f64; 4]>>(),
            // SAFETY: a width of this kind exists only where the processor was asked for it.
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)]
            Kind::Avx2 => unsafe { with_avx2(work) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            #[allow(unsafe_code)]
            Kind::Avx512 => unsafe { with_avx512(work) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<W: Work>(work: W) -> W::Output {
    work.run::<Wide<x86_64::__m256d>>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn with_avx512<W: Work>(work: W) -> W::Output {
    work.run::<Wide<x86_64::__m512d>>()
}
