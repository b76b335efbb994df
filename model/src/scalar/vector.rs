//! The machine's vectors: the few operations from which [`super::wide::Wide`] makes a number.

use std::fmt::Debug;

/// A vector register of doubles.
///
/// The types behind this trait compute with instructions that not every processor has. They are
/// private to this crate, where [`crate::lanes`] asks the processor before any such value can
/// exist.
pub(crate) trait Vector: Copy + Debug + 'static {
    /// How many doubles it holds.
    const COUNT: usize;
    fn splat(value: f64) -> Self;
    fn get(&self, lane: usize) -> f64;
    fn set(&mut self, lane: usize, value: f64);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    fn neg(self) -> Self;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    /// `then` where `self < bound`, else `otherwise`.
    fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self;
    /// Whether `self < bound` anywhere.
    fn is_any_below(self, bound: Self) -> bool;
    /// 2ⁿ for whole n from −1022 to 1023.
    fn power_of_two(self) -> Self;
}

/// 1.5 · 2⁵²: added to a number of magnitude below 2⁵¹, it leaves the nearest whole number in the
/// lowest bits of the significand.
pub(super) const ROUNDING: f64 = 6_755_399_441_055_744.0;
/// The exponent's offset in a double.
const BIAS: f64 = 1023.0;

impl<const L: usize> Vector for [f64; L] {
    const COUNT: usize = L;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        [value; L]
    }
    #[inline(always)]
    fn get(&self, lane: usize) -> f64 {
        self[lane]
    }
    #[inline(always)]
    fn set(&mut self, lane: usize, value: f64) {
        self[lane] = value;
    }
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] + other[i])
    }
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] - other[i])
    }
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] * other[i])
    }
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        std::array::from_fn(|i| self[i] / other[i])
    }
    #[inline(always)]
    fn neg(self) -> Self {
        std::array::from_fn(|i| -self[i])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        std::array::from_fn(|i| self[i].abs())
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        std::array::from_fn(|i| self[i].sqrt())
    }
    #[inline(always)]
    fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
        std::array::from_fn(|i| if self[i] < bound[i] { then[i] } else { otherwise[i] })
    }
    #[inline(always)]
    fn is_any_below(self, bound: Self) -> bool {
        (0..L).any(|i| self[i] < bound[i])
    }
    #[inline(always)]
    fn power_of_two(self) -> Self {
        std::array::from_fn(|i| f64::from_bits((self[i] + (ROUNDING + BIAS)).to_bits() << 52))
    }
}

/// Implements [`Vector`] by the intrinsics of one width.
#[cfg(target_arch = "x86_64")]
macro_rules! implement_by_intrinsics {
    ($vector:ident, $count:literal, $splat:ident $add:ident $sub:ident $mul:ident $div:ident $sqrt:ident,
     $neg:expr, $abs:expr, $where_below:expr, $is_any_below:expr, $power:expr) => {
        #[allow(unsafe_code)]
        // SAFETY, for all of them: the instructions are there, because `lanes::Width` lets values
        // of this type exist only after it has asked the processor; and the vector is so many
        // doubles and nothing else, so that it may be looked at as an array of them.
        impl Vector for x86_64::$vector {
            const COUNT: usize = $count;
            #[inline(always)]
            fn splat(value: f64) -> Self {
                unsafe { x86_64::$splat(value) }
            }
            #[inline(always)]
            fn get(&self, lane: usize) -> f64 {
                let lanes: &[f64; $count] = unsafe { &*std::ptr::from_ref(self).cast() };
                lanes[lane]
            }
            #[inline(always)]
            fn set(&mut self, lane: usize, value: f64) {
                let lanes: &mut [f64; $count] = unsafe { &mut *std::ptr::from_mut(self).cast() };
                lanes[lane] = value;
            }
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                unsafe { x86_64::$add(self, other) }
            }
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                unsafe { x86_64::$sub(self, other) }
            }
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                unsafe { x86_64::$mul(self, other) }
            }
            #[inline(always)]
            fn div(self, other: Self) -> Self {
                unsafe { x86_64::$div(self, other) }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                unsafe { x86_64::$sqrt(self) }
            }
            #[inline(always)]
            fn neg(self) -> Self {
                unsafe { $neg(self) }
            }
            #[inline(always)]
            fn abs(self) -> Self {
                unsafe { $abs(self) }
            }
            #[inline(always)]
            fn where_below(self, bound: Self, then: Self, otherwise: Self) -> Self {
                unsafe { $where_below(self, bound, then, otherwise) }
            }
            #[inline(always)]
            fn is_any_below(self, bound: Self) -> bool {
                unsafe { $is_any_below(self, bound) }
            }
            #[inline(always)]
            fn power_of_two(self) -> Self {
                unsafe { $power(self.add(Self::splat(ROUNDING + BIAS))) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64;

#[cfg(target_arch = "x86_64")]
implement_by_intrinsics!(
    __m512d, 8, _mm512_set1_pd _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd _mm512_sqrt_pd,
    |x| x86_64::_mm512_castsi512_pd(x86_64::_mm512_xor_si512(
        x86_64::_mm512_castpd_si512(x),
        x86_64::_mm512_set1_epi64(i64::MIN)
    )),
    |x| x86_64::_mm512_abs_pd(x),
    |x, bound, then, otherwise| x86_64::_mm512_mask_blend_pd(
        x86_64::_mm512_cmp_pd_mask::<{ x86_64::_CMP_LT_OQ }>(x, bound),
        otherwise,
        then
    ),
    |x, bound| x86_64::_mm512_cmp_pd_mask::<{ x86_64::_CMP_LT_OQ }>(x, bound) != 0,
    |x| x86_64::_mm512_castsi512_pd(x86_64::_mm512_slli_epi64::<52>(x86_64::_mm512_castpd_si512(x)))
);

#[cfg(target_arch = "x86_64")]
implement_by_intrinsics!(
    __m256d, 4, _mm256_set1_pd _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd _mm256_sqrt_pd,
    |x| x86_64::_mm256_xor_pd(x, x86_64::_mm256_set1_pd(-0.0)),
    |x| x86_64::_mm256_andnot_pd(x86_64::_mm256_set1_pd(-0.0), x),
    |x, bound, then, otherwise| x86_64::_mm256_blendv_pd(
        otherwise,
        then,
        x86_64::_mm256_cmp_pd::<{ x86_64::_CMP_LT_OQ }>(x, bound)
    ),
    |x, bound| {
        x86_64::_mm256_movemask_pd(x86_64::_mm256_cmp_pd::<{ x86_64::_CMP_LT_OQ }>(x, bound)) != 0
    },
    |x| x86_64::_mm256_castsi256_pd(x86_64::_mm256_slli_epi64::<52>(x86_64::_mm256_castpd_si256(x)))
);
