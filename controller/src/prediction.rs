//! Aiming at the instant the torque takes effect.

use mtj_model::{PLANE, scalar::Scalar, scenario::Horizon};
use nalgebra::SVector;

/// Where the tip is, or will be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip<T> {
    /// The instant meant, s since the run began.
    pub time: T,
    /// m.
    pub position: SVector<T, PLANE>,
    /// m/s.
    pub velocity: SVector<T, PLANE>,
}

impl<T: Scalar> Tip<T> {
    /// Before the first sample: nothing is later than this.
    pub fn unknown() -> Self {
        let nowhere = SVector::zeros();
        Self { time: T::constant(f64::INFINITY), position: nowhere, velocity: nowhere }
    }

    /// The tip's acceleration since an earlier sample, a = (v_k − v_{k−1})/(t_k − t_{k−1}), m/s²; zero
    /// at the first sample.
    #[inline(always)]
    pub fn acceleration_since(&self, previous: &Self) -> SVector<T, PLANE> {
        let period = self.time - previous.time;
        let mut acceleration = SVector::zeros();
        for i in 0..PLANE {
            let difference = (self.velocity[i] - previous.velocity[i]) / period;
            acceleration[i] = previous.time.where_below(self.time, difference, T::zero());
        }
        acceleration
    }

    /// The tip a horizon d from now, in s: x̂ = x + d v + ½ d² a and v̂ = v + d a.
    #[inline(always)]
    pub fn ahead(&self, horizon: T, acceleration: &SVector<T, PLANE>) -> Self {
        let half_square = T::constant(0.5) * horizon * horizon;
        Self {
            time: self.time + horizon,
            position: self.position + self.velocity * horizon + acceleration * half_square,
            velocity: self.velocity + acceleration * horizon,
        }
    }
}

/// How far ahead to aim, in s, when the plant has measured this latency in ns; `None` for not at all.
pub fn horizon(wanted: Option<Horizon>, latency_ns: u64) -> Option<f64> {
    wanted.map(|horizon| match horizon {
        Horizon::Fixed(horizon) => horizon.as_secs_f64(),
        Horizon::Measured => latency_ns as f64 * 1e-9,
    })
}
