//! Prediction: the tip at the instant that the torque takes effect.

use mtj_model::{
    scalar::Scalar,
    scenario::Horizon,
    task::{Task, Tip},
};
use nalgebra::SVector;

/// The tip a horizon d from now, s: x̂ = x ⊕ (d v + ½ d² a) and v̂ = v + d a.
#[inline(always)]
pub fn ahead<T: Scalar, P: Task<T, M>, const M: usize>(
    tip: &Tip<T, P, M>,
    horizon: T,
    acceleration: &SVector<T, M>,
) -> Tip<T, P, M> {
    let half_square = T::constant(0.5) * horizon * horizon;
    Tip {
        time: tip.time + horizon,
        point: tip
            .point
            .integrate(&(tip.velocity * horizon))
            .integrate(&(acceleration * half_square)),
        velocity: tip.velocity + acceleration * horizon,
    }
}

/// How far ahead to aim, in s, when the plant has measured this latency in ns; `None` for not at
/// all.
pub fn horizon(wanted: Option<Horizon>, latency_ns: u64) -> Option<f64> {
    wanted.map(|horizon| match horizon {
        Horizon::Fixed(horizon) => horizon.as_secs_f64(),
        Horizon::Measured => latency_ns as f64 * 1e-9,
    })
}
