//! The sampled loop of one mass, as a linear map from one sampling instant to the next.
//!
//! Seen from the tip, and for small errors, the arm is a mass m that a force moves: m ẍ = F, x =
//! −e. Here the real law answers a [`PointMass`]: no law's equation is written a second time. With
//! the regulating factor held constant its answer is linear in the measured x and v, in a = (v_k −
//! v_{k−1})/T_s, and in what it remembers.
//!
//! With a latency of n whole periods and a fraction φ of one, the plant holds F_{k−n−1} for the
//! first φ T_s after a sample, and F_{k−n} for the rest of the period. The memory M_k is
//!
//! ```text
//! sent        F_{k−1}
//! applied     what is held at t_k:                        F_{k−n−1}
//! delivered   its mean over the period that ends at t_k:  φ F_{k−n−2} + (1−φ) F_{k−n−1}
//! ```

use mtj_controller::responder::{Context, Measured, Responder};
use mtj_model::{
    MAX_SIGNALS, MAX_STATE,
    arm::point_mass::PointMass,
    law::Law,
    matrix::padded,
    scenario::MemoryPolicy,
    task::Previous,
    trajectory::{Path, PointToPoint},
};
use nalgebra::{DMatrix, DVector, SVector, Vector2};

/// The loop of a law around a mass on `M` axes.
#[derive(Clone, Copy, Debug)]
pub struct LinearLoop<const M: usize> {
    /// The law, with a constant regulating factor.
    pub law: Law<f64, M>,
    /// m, the effective mass at the tip, kg.
    pub mass: f64,
    /// The mass in the controller's model, kg.
    pub model_mass: f64,
    /// T_s, s.
    pub period: f64,
    /// Sample instant to application, s.
    pub latency: f64,
    /// The force that a law with a memory remembers.
    pub memory: MemoryPolicy,
    /// Whether the law aims a latency ahead.
    pub predicts: bool,
}

/// The largest step matrix whose eigenvalues are computed.
const LARGEST_MATRIX: usize = 32;
/// How often a larger one is applied: long enough for all but the slowest mode to die out.
const ITERATIONS: usize = 16_384;
/// How often the state is scaled back meanwhile.
const WINDOW: usize = 64;

/// The desired motion: rest at the origin.
const REST: Path<f64> = Path::PointToPoint(PointToPoint {
    from: Vector2::new(0.0, 0.0),
    to: Vector2::new(0.0, 0.0),
    duration: 1.0,
});

/// The loop's state at a sampling instant.
struct State<'a, const M: usize> {
    x: SVector<f64, M>,
    v: SVector<f64, M>,
    /// v a period ago.
    v_before: SVector<f64, M>,
    /// The force in a memory at the plant.
    echoed: SVector<f64, M>,
    /// F_{k−1}, F_{k−2}, …
    forces: &'a [f64],
}

impl<const M: usize> LinearLoop<M> {
    /// Whole periods of latency.
    fn whole_periods(&self) -> usize {
        // A latency that is a whole number of periods but for rounding is that number.
        ((self.latency / self.period) * (1.0 + 1e-12)).floor() as usize
    }

    /// Size of the step matrix: on each axis x, v, v a period ago, the echoed force, and all forces
    /// on their way.
    fn size(&self) -> usize {
        M * (4 + self.whole_periods() + 2)
    }

    /// The force of the law, N.
    fn force(&self, state: &State<'_, M>) -> SVector<f64, M> {
        let remembered = match self.memory {
            MemoryPolicy::Sent => vector(state.forces, 0),
            MemoryPolicy::Applied | MemoryPolicy::Delivered => state.echoed,
        };
        let echo = padded(remembered.as_slice());
        let context = Context {
            previous: Previous { time: -self.period, velocity: state.v_before },
            horizon: self.predicts.then_some(self.latency),
            echo: Some(&echo),
            precomputed: None,
        };
        let arm = PointMass { mass: self.model_mass };
        let responder = Responder { arm, trajectory: REST.into(), law: self.law };
        let at = [state.x, state.v];
        let measured =
            Measured { time: 0.0, position: &state.x, velocity: &state.v, at: &at, ahead: None };
        let (mut kept, mut unseen) = ([0.0; MAX_STATE], [0.0; MAX_SIGNALS]);
        responder.respond(&measured, &context, &mut kept, &mut unseen).command.torque
    }

    /// The state one period on.
    fn step(&self, state: &[f64]) -> Vec<f64> {
        let state = State {
            x: vector(state, 0),
            v: vector(state, 1),
            v_before: vector(state, 2),
            echoed: vector(state, 3),
            forces: &state[4 * M..],
        };
        let (n, period) = (self.whole_periods(), self.period);
        let fraction = (self.latency / period - n as f64).max(0.0);
        let force = self.force(&state);
        // F_k, F_{k−1}, …
        let all = |i: usize| if i == 0 { force } else { vector(state.forces, i - 1) };
        let (old, new) = (all(n + 1), all(n));
        let (first, second) = (fraction * period, (1.0 - fraction) * period);
        let (middle_x, middle_v) = self.drift(state.x, state.v, old, first);
        let (next_x, next_v) = self.drift(middle_x, middle_v, new, second);
        let echo = match self.memory {
            MemoryPolicy::Delivered => old * fraction + new * (1.0 - fraction),
            // A command that arrives at the very instant of a sample is in effect when it is taken.
            _ if fraction == 0.0 && n > 0 => all(n - 1),
            _ => new,
        };
        let mut next = Vec::with_capacity(self.size());
        for part in [next_x, next_v, state.v, echo, force] {
            next.extend_from_slice(part.as_slice());
        }
        next.extend_from_slice(&state.forces[..state.forces.len() - M]);
        next
    }

    /// The mass under a held force.
    fn drift(
        &self,
        x: SVector<f64, M>,
        v: SVector<f64, M>,
        force: SVector<f64, M>,
        time: f64,
    ) -> (SVector<f64, M>, SVector<f64, M>) {
        let a = force / self.mass;
        (x + v * time + a * (0.5 * time * time), v + a * time)
    }

    /// The matrix of one step: its columns are the steps of the unit states.
    pub fn step_matrix(&self) -> DMatrix<f64> {
        let size = self.size();
        let unit =
            |i: usize| -> Vec<f64> { (0..size).map(|j| if i == j { 1.0 } else { 0.0 }).collect() };
        let columns: Vec<_> = (0..size).map(|i| DVector::from_vec(self.step(&unit(i)))).collect();
        DMatrix::from_columns(&columns)
    }

    /// The spectral radius of the step matrix: errors decay if it is below one.
    ///
    /// By its eigenvalues while it is small. A latency of many periods makes it large; then by the
    /// growth of a state that is stepped until only the slowest mode is left.
    pub fn spectral_radius(&self) -> f64 {
        if self.size() <= LARGEST_MATRIX {
            let eigenvalues = self.step_matrix().complex_eigenvalues();
            return eigenvalues.iter().map(|z| z.norm()).fold(0.0, f64::max);
        }
        let mut state: Vec<f64> = vec![0.0; self.size()];
        state[..M].fill(1.0);
        let mut log_size = 0.0;
        let mut early = 0.0;
        for i in 0..ITERATIONS {
            state = self.step(&state);
            if i % WINDOW == WINDOW - 1 {
                let size = state.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
                log_size += size.ln();
                state.iter_mut().for_each(|entry| *entry /= size);
                if i < ITERATIONS / 2 {
                    early = log_size;
                }
            }
        }
        ((log_size - early) / (ITERATIONS / 2) as f64).exp()
    }

    /// The largest latency, up to `most`, below which every latency keeps the radius below one, s;
    /// `None` if not even none does.
    pub fn largest_latency(&self, most: f64) -> Option<f64> {
        let is_stable = |latency: f64| Self { latency, ..*self }.spectral_radius() < 1.0;
        if !is_stable(0.0) {
            return None;
        }
        // March to the first loss of stability, then close in on it.
        let mut below = 0.0;
        while below < most {
            let above = (below + self.period / 50.0).max(1.05 * below).min(most);
            if !is_stable(above) {
                return Some(close_in(below, above, is_stable));
            }
            below = above;
        }
        Some(most)
    }
}

/// The vector at a place in a list of vectors.
fn vector<const M: usize>(list: &[f64], place: usize) -> SVector<f64, M> {
    SVector::from_fn(|axis, _| list[place * M + axis])
}

/// Halves the way between a stable and an unstable value until nothing but rounding is between
/// them.
pub(crate) fn close_in(mut below: f64, mut above: f64, is_stable: impl Fn(f64) -> bool) -> f64 {
    while above - below > 1e-9 * above {
        let middle = 0.5 * (below + above);
        if is_stable(middle) { below = middle } else { above = middle }
    }
    below
}

#[cfg(test)]
mod tests;
