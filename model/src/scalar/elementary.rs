//! Sine, cosine and exponential of several numbers at once, without branches and tables, to about
//! an ulp: what makes a vector a [`Scalar`].
//!
//! The argument is brought close to zero by taking away a whole number of steps, π/2 or ln 2, whose
//! length is given in pieces so short that the multiples are exact (W. J. Cody and W. Waite,
//! *Software Manual for the Elementary Functions*, 1980). There Taylor's series is short.

use num_traits::{One, Zero};

use super::{Scalar, vector::Vector, wide::Wide};

/// π/2 in pieces: 33 bits, and what is left of it in a double.
const QUARTER_TURN: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_506_192e-11];
/// ln 2 in pieces: 32 bits, and what is left of it in a double.
const LN_2: [f64; 2] = [0.693_147_180_369_123_8, 1.908_214_929_270_587_7e-10];
/// Beyond these, eˣ is zero or infinite in a double.
const EXPONENTS: [f64; 2] = [-708.0, 709.0];

/// (−1)ⁿ/(2n+1)! for n = 1 to 7. The first term left out, r¹⁷/17!, is below 5e-17 for |r| ≤ π/4.
const SINE: [f64; 7] = [
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5_040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
];
/// (−1)ⁿ/(2n)! for n = 2 to 8. The first term left out, r¹⁸/18!, is below 3e-18.
const COSINE: [f64; 7] = [
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];
/// 1/n! for n = 2 to 13. The first term left out, r¹⁴/14!, is below 5e-18 for |r| ≤ (ln 2)/2.
const EXPONENTIAL: [f64; 12] = [
    1.0 / 2.0,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

/// Sine and cosine of an angle in radians of magnitude below 10⁶.
#[inline(always)]
pub(super) fn sin_cos<V: Vector>(x: Wide<V>) -> (Wide<V>, Wide<V>) {
    let c = Wide::<V>::constant;
    let quarters = (x * c(std::f64::consts::FRAC_2_PI)).round();
    let r = (x - quarters * c(QUARTER_TURN[0])) - quarters * c(QUARTER_TURN[1]);
    let z = r * r;
    let sin = r + r * z * seven_terms(z, SINE);
    let cos = c(1.0) - (z * c(0.5) - z * z * seven_terms(z, COSINE));
    // The quarter turn that is left, −2 to 2.
    let turn = quarters - (quarters * c(0.25)).round() * c(4.0);
    let is_odd = |then, otherwise| {
        let distance = (turn.abs() - c(1.0)).abs();
        distance.where_below(c(0.5), then, otherwise)
    };
    let (sine, cosine) = (is_odd(cos, sin), is_odd(sin, cos));
    // Sine is negative in the quarters −1, 2 and −2, cosine in 1, 2 and −2.
    let middle = turn - c(0.5);
    let sine = c(1.0).where_below(middle.abs(), -sine, sine);
    let middle = turn + c(0.5);
    let cosine = c(1.0).where_below(middle.abs(), -cosine, cosine);
    (sine, cosine)
}

/// eˣ.
#[inline(always)]
pub(super) fn exp<V: Vector>(x: Wide<V>) -> Wide<V> {
    let c = Wide::<V>::constant;
    let n = (x * c(std::f64::consts::LOG2_E)).round();
    let r = (x - n * c(LN_2[0])) - n * c(LN_2[1]);
    let power = Wide::one() + (r + (r * r) * twelve_terms(r, EXPONENTIAL));
    let [least, most] = EXPONENTS.map(c);
    let within = x.where_below(least, Wide::zero(), power * n.power_of_two());
    most.where_below(x, c(f64::INFINITY), within)
}

// Polynomials by parts that do not wait for each other (Estrin's scheme): what counts is how long a
// chain of operations is, more than how many there are.

/// a₀ + a₁ z + a₂ z² + a₃ z³.
#[inline(always)]
fn four_terms<V: Vector>(z: Wide<V>, square: Wide<V>, coefficients: [f64; 4]) -> Wide<V> {
    let [a0, a1, a2, a3] = coefficients.map(Wide::<V>::constant);
    (a0 + a1 * z) + (a2 + a3 * z) * square
}

/// a₀ + a₁ z + … + a₆ z⁶.
#[inline(always)]
fn seven_terms<V: Vector>(z: Wide<V>, coefficients: [f64; 7]) -> Wide<V> {
    let [a0, a1, a2, a3, a4, a5, a6] = coefficients;
    let square = z * z;
    let [a4, a5, a6] = [a4, a5, a6].map(Wide::<V>::constant);
    let high = (a4 + a5 * z) + a6 * square;
    four_terms(z, square, [a0, a1, a2, a3]) + high * (square * square)
}

/// a₀ + a₁ z + … + a₁₁ z¹¹.
#[inline(always)]
fn twelve_terms<V: Vector>(z: Wide<V>, coefficients: [f64; 12]) -> Wide<V> {
    let [a0, a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11] = coefficients;
    let square = z * z;
    let fourth = square * square;
    let high = four_terms(z, square, [a8, a9, a10, a11]);
    let middle = four_terms(z, square, [a4, a5, a6, a7]) + high * fourth;
    four_terms(z, square, [a0, a1, a2, a3]) + middle * fourth
}

impl<V: Vector> Scalar for Wide<V> {
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        sin_cos(self)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        exp(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn look_up<const K: usize>(self, look_up: impl Fn(f64) -> [f64; K]) -> [Self; K] {
        let mut found = [Self::splat(0.0); K];
        for lane in 0..V::COUNT {
            for (all, number) in found.iter_mut().zip(look_up(self.0.get(lane))) {
                all.0.set(lane, number);
            }
        }
        found
    }
    #[inline(always)]
    fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
        Self(self.0.where_below(bound.0, then.0, otherwise.0))
    }
}
