//! The sampled loop of one mass, as a linear map from one sampling instant to the next.
//!
//! Seen from the tip, and for small errors, the arm is a mass m that a force moves: m ẍ = F, x = −e.
//! The law sees x and v = ẋ every T_s and answers
//!
//! ```text
//! F_k = −K_p x̂ − K_d v̂ + k M_k          (mtj; tj has k = 0; mb has no M and m times the gains)
//! x̂ = x + d v + ½ d² a,  v̂ = v + d a,  a = (v_k − v_{k−1})/T_s      (with prediction; else d = 0)
//! ```
//!
//! With a latency of n whole periods and a fraction φ of one, the plant holds F_{k−n−1} for the first
//! φ T_s after a sample, and F_{k−n} for the rest of the period. The memory M_k is
//!
//! ```text
//! sent        F_{k−1}
//! applied     what is held at t_k:                        F_{k−n−1}
//! delivered   its mean over the period that ends at t_k:  φ F_{k−n−2} + (1−φ) F_{k−n−1}
//! ```

use mtj_model::scenario::MemoryPolicy;
use nalgebra::{DMatrix, DVector};

/// One axis of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearLoop {
    /// m, the effective mass at the tip, kg.
    pub mass: f64,
    /// K_p, N/m.
    pub kp: f64,
    /// K_d, N s/m.
    pub kd: f64,
    /// T_s, s.
    pub period: f64,
    /// Sample instant to application, s.
    pub latency: f64,
    /// k and whose force is remembered; `None` for a law without a memory.
    pub memory: Option<(f64, MemoryPolicy)>,
    /// Whether the law aims a latency ahead.
    pub predicts: bool,
}

/// The largest step matrix whose eigenvalues are computed.
const LARGEST_MATRIX: usize = 32;
/// How often a larger one is applied: long enough for all but the slowest mode to die out.
const ITERATIONS: usize = 16_384;
/// How often the state is scaled back meanwhile.
const WINDOW: usize = 64;

/// The loop's state at a sampling instant.
struct State<'a> {
    x: f64,
    v: f64,
    /// v a period ago.
    v_before: f64,
    /// What a memory at the plant holds.
    echoed: f64,
    /// F_{k−1}, F_{k−2}, …
    forces: &'a [f64],
}

impl LinearLoop {
    /// Whole periods of latency.
    fn whole_periods(&self) -> usize {
        // A latency that is a whole number of periods but for rounding is that number.
        ((self.latency / self.period) * (1.0 + 1e-12)).floor() as usize
    }

    /// Size of the step matrix: x, v, v a period ago, the echoed force, and all forces on their way.
    fn size(&self) -> usize {
        4 + self.whole_periods() + 2
    }

    /// The state one period on.
    fn step(&self, state: &State<'_>) -> Vec<f64> {
        let (n, period) = (self.whole_periods(), self.period);
        let fraction = (self.latency / period - n as f64).max(0.0);
        let State { x, v, v_before, echoed, forces } = *state;
        let d = if self.predicts { self.latency } else { 0.0 };
        let a = (v - v_before) / period;
        let remembered = match self.memory {
            None => 0.0,
            Some((k, MemoryPolicy::Sent)) => k * forces[0],
            Some((k, MemoryPolicy::Applied | MemoryPolicy::Delivered)) => k * echoed,
        };
        let force = -self.kp * (x + d * v + 0.5 * d * d * a) - self.kd * (v + d * a) + remembered;
        // F_k, F_{k−1}, …
        let all = |i: usize| if i == 0 { force } else { forces[i - 1] };
        let (old, new) = (all(n + 1), all(n));
        let (first, second) = (fraction * period, (1.0 - fraction) * period);
        let (middle_x, middle_v) = self.drift(x, v, old, first);
        let (next_x, next_v) = self.drift(middle_x, middle_v, new, second);
        let echo = match self.memory {
            Some((_, MemoryPolicy::Delivered)) => fraction * old + (1.0 - fraction) * new,
            // A command that arrives at the very instant of a sample is in effect when it is taken.
            _ if fraction == 0.0 && n > 0 => all(n - 1),
            _ => new,
        };
        let mut next = vec![next_x, next_v, v, echo, force];
        next.extend_from_slice(&forces[..forces.len() - 1]);
        next
    }

    /// The mass under a held force.
    fn drift(&self, x: f64, v: f64, force: f64, time: f64) -> (f64, f64) {
        let a = force / self.mass;
        (x + v * time + 0.5 * a * time * time, v + a * time)
    }

    /// The matrix of one step: its columns are the steps of the unit states.
    pub fn step_matrix(&self) -> DMatrix<f64> {
        let size = self.size();
        let columns: Vec<_> = (0..size)
            .map(|i| {
                let unit: Vec<f64> = (0..size).map(|j| if i == j { 1.0 } else { 0.0 }).collect();
                DVector::from_vec(self.step(&State {
                    x: unit[0],
                    v: unit[1],
                    v_before: unit[2],
                    echoed: unit[3],
                    forces: &unit[4..],
                }))
            })
            .collect();
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
        state[0] = 1.0;
        let mut log_size = 0.0;
        let mut early = 0.0;
        for i in 0..ITERATIONS {
            let (x, v, v_before, echoed) = (state[0], state[1], state[2], state[3]);
            state = self.step(&State { x, v, v_before, echoed, forces: &state[4..] });
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

/// Halves the way between a stable and an unstable value until nothing but rounding is between them.
fn close_in(mut below: f64, mut above: f64, is_stable: impl Fn(f64) -> bool) -> f64 {
    while above - below > 1e-9 * above {
        let middle = 0.5 * (below + above);
        if is_stable(middle) { below = middle } else { above = middle }
    }
    below
}

/// How far below one k must stay for a loop with a memory to be stable, to second order in the phases
/// at crossover, for latencies of less than a period (derived in `docs/latency.md`):
///
/// ```text
/// sent, applied   1 − k > K_p T_s/K_d + K_d d/m
/// delivered       1 − k > K_p (T_s + d)/K_d + K_d d²/(m (T_s + d))
/// ```
pub fn least_leak(law: &LinearLoop, policy: MemoryPolicy) -> f64 {
    let LinearLoop { mass, kp, kd, period, latency, .. } = *law;
    match policy {
        MemoryPolicy::Sent | MemoryPolicy::Applied => kp * period / kd + kd * latency / mass,
        MemoryPolicy::Delivered => {
            let lag = period + latency;
            kp * lag / kd + kd * latency * latency / (mass * lag)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// k at which the loop is just stable.
    fn critical_leak(law: &LinearLoop, policy: MemoryPolicy) -> f64 {
        let is_stable = |leak: f64| {
            let memory = Some((1.0 - leak, policy));
            LinearLoop { memory, ..*law }.spectral_radius() < 1.0
        };
        1.0 - close_in(0.0, 1.0, |k| is_stable(1.0 - k))
    }

    #[test]
    fn the_closed_forms_agree_with_the_matrices() {
        for (mass, period) in [(1.05, 0.01), (2.0, 0.01), (4.4, 0.01), (1.05, 0.002), (2.0, 0.005)]
        {
            for policy in [MemoryPolicy::Sent, MemoryPolicy::Delivered] {
                for part in [0.0, 0.02, 0.05, 0.1, 0.15] {
                    let law = LinearLoop {
                        mass,
                        kp: 30.0,
                        kd: 60.0,
                        period,
                        latency: part * period,
                        memory: None,
                        predicts: false,
                    };
                    let (exact, short) = (critical_leak(&law, policy), least_leak(&law, policy));
                    assert!(
                        (short / exact - 1.0).abs() < 0.15,
                        "{law:?} {policy:?}: {short} for {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn without_latency_the_condition_on_k_is_exact_and_free_of_the_mass() {
        for mass in [0.9, 2.0, 10.0] {
            let law = LinearLoop {
                mass,
                kp: 30.0,
                kd: 60.0,
                period: 0.01,
                latency: 0.0,
                memory: None,
                predicts: false,
            };
            let bound = (2.0 * law.kd - law.kp * law.period) / (2.0 * law.kd + law.kp * law.period);
            let exact = 1.0 - critical_leak(&law, MemoryPolicy::Sent);
            assert!((exact - bound).abs() < 1e-6, "{exact} for {bound}");
        }
    }

    #[test]
    fn with_prediction_a_delivered_memory_is_stable_even_at_k_one() {
        let radius = |latency, predicts| {
            let memory = Some((1.0, MemoryPolicy::Delivered));
            LinearLoop { mass: 2.0, kp: 30.0, kd: 60.0, period: 0.01, latency, memory, predicts }
                .spectral_radius()
        };
        for latency in [0.002, 0.005, 0.01, 0.02] {
            assert!(radius(latency, true) < 1.0, "{latency}: {}", radius(latency, true));
            assert!(radius(latency, false) > 1.0);
        }
    }

    fn paper(latency: f64, k: f64, policy: MemoryPolicy) -> f64 {
        let loop_ = LinearLoop {
            mass: 2.0,
            kp: 30.0,
            kd: 60.0,
            period: 0.01,
            latency,
            memory: Some((k, policy)),
            predicts: false,
        };
        loop_.spectral_radius()
    }

    #[test]
    fn the_held_loop_is_not_asymptotically_stable_at_k_one_even_without_latency() {
        let is = |radius: f64, expected: f64| (radius - expected).abs() < 5e-5;
        for policy in [MemoryPolicy::Sent, MemoryPolicy::Applied, MemoryPolicy::Delivered] {
            assert!(is(paper(0.0, 1.0, policy), 1.0025), "{}", paper(0.0, 1.0, policy));
            assert!(is(paper(0.0, 0.99, policy), 0.9975));
        }
        assert!(is(paper(0.001, 0.99, MemoryPolicy::Sent), 1.0125));
        assert!(is(paper(0.001, 0.99, MemoryPolicy::Delivered), 0.9993));
    }
}
