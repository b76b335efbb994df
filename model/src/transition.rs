//! From one desired motion to another while a loop runs.

use nalgebra::Vector2;

use crate::{lift, scalar::Scalar};

/// What is added to a motion so that it begins where another one was: a quintic polynomial that
/// takes the difference of point, velocity and acceleration to zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition<T> {
    /// When the motion took effect, s.
    pub begin: T,
    /// How long the way takes, s.
    pub duration: T,
    /// How much later than the run the motion's own time begins, s.
    pub shift: T,
    /// Other motion − this one at the beginning: point, velocity and acceleration, m, m/s, m/s².
    pub offset: [Vector2<T>; 3],
}

impl<T: Scalar> Transition<T> {
    /// What is left of the offset at `time`, s: of point, velocity and acceleration.
    #[inline(always)]
    pub(crate) fn rest(&self, time: T) -> [Vector2<T>; 3] {
        let c = T::constant;
        let (zero, one) = (T::zero(), T::one());
        let s = (time - self.begin) / self.duration;
        let s = zero.where_below(s, s, zero);
        let s = s.where_below(one, s, one);
        // At s = 1 all of them are exactly zero.
        let point = [
            one - s * s * s * (c(10.0) - s * (c(15.0) - c(6.0) * s)),
            s * (one - s * s * (c(6.0) - s * (c(8.0) - c(3.0) * s))),
            c(0.5) * s * s * (one - s * (c(3.0) - s * (c(3.0) - s))),
        ];
        let velocity = [
            c(-30.0) * s * s * (one - s * (c(2.0) - s)),
            one - s * s * (c(18.0) - s * (c(32.0) - c(15.0) * s)),
            c(0.5) * s * (c(2.0) - s * (c(9.0) - s * (c(12.0) - c(5.0) * s))),
        ];
        let acceleration = [
            c(-60.0) * s * (one - s * (c(3.0) - c(2.0) * s)),
            c(-12.0) * s * (c(3.0) - s * (c(8.0) - c(5.0) * s)),
            one - s * (c(9.0) - s * (c(18.0) - c(10.0) * s)),
        ];
        let d = self.duration;
        let scaled = [self.offset[0], self.offset[1] * d, self.offset[2] * (d * d)];
        let sum =
            |parts: [T; 3]| scaled[0] * parts[0] + scaled[1] * parts[1] + scaled[2] * parts[2];
        [sum(point), sum(velocity) / d, sum(acceleration) / (d * d)]
    }
}

lift! { struct Transition<T> { begin, duration, shift, offset } }
