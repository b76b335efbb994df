//! Aiming at the instant the torque takes effect.

use mtj_model::{PLANE, scenario::Horizon};
use mtj_protocol::sample::StateSample;
use nalgebra::SVector;

/// Where the tip is, or will be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip {
    /// The instant meant, s since the run began.
    pub time: f64,
    /// m.
    pub position: SVector<f64, PLANE>,
    /// m/s.
    pub velocity: SVector<f64, PLANE>,
}

/// Extrapolates the tip's motion by the loop's latency, without any model of the arm.
#[derive(Clone, Copy, Debug)]
pub struct Predictor {
    horizon: Option<Horizon>,
    previous: Option<Tip>,
}

impl Predictor {
    /// A predictor that has seen nothing yet.
    pub fn new(horizon: Option<Horizon>) -> Self {
        Self { horizon, previous: None }
    }

    /// Forgets the last sample.
    pub fn forget(&mut self) {
        self.previous = None;
    }

    /// The same predictor with another horizon.
    pub fn adopt(self, horizon: Option<Horizon>) -> Self {
        Self { horizon, ..self }
    }

    /// The tip's acceleration a = (v_k − v_{k−1})/(t_k − t_{k−1}), m/s²; zero at the first sample.
    pub fn acceleration(&self, now: &Tip) -> SVector<f64, PLANE> {
        match self.previous {
            Some(previous) if now.time > previous.time => {
                (now.velocity - previous.velocity) / (now.time - previous.time)
            }
            _ => SVector::zeros(),
        }
    }

    /// The tip a horizon d from now: x̂ = x + d v + ½ d² a and v̂ = v + d a.
    pub fn ahead(&self, now: &Tip, acceleration: &SVector<f64, PLANE>, state: &StateSample) -> Tip {
        let d = match self.horizon {
            None => return *now,
            Some(Horizon::Fixed(horizon)) => horizon.as_secs_f64(),
            Some(Horizon::Measured) => state.latency_ns as f64 * 1e-9,
        };
        Tip {
            time: now.time + d,
            position: now.position + now.velocity * d + acceleration * (0.5 * d * d),
            velocity: now.velocity + acceleration * d,
        }
    }

    /// Remembers a sample for the next difference.
    pub fn store(&mut self, now: &Tip) {
        self.previous = Some(*now);
    }
}
