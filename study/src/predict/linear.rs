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
    pub fn spectral_radius(&self) -> f64 {
        self.step_matrix().complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max)
    }

    /// The largest latency, up to `most`, below which every latency keeps the radius below one, s;
    /// `None` if not even none does.
    pub fn largest_latency(&self, most: f64) -> Option<f64> {
        let is_stable = |latency: f64| Self { latency, ..*self }.spectral_radius() < 1.0;
        if !is_stable(0.0) {
            return None;
        }
        // March to the first loss of stability, then close in on it.
        let stride = (self.period / 50.0).min(most / 200.0);
        let mut below = 0.0;
        while below < most {
            let above = (below + stride).min(most);
            if !is_stable(above) {
                return Some(close_in(below, above, is_stable));
            }
            below = above;
        }
        Some(most)
    }
}

fn close_in(mut below: f64, mut above: f64, is_stable: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..30 {
        let middle = 0.5 * (below + above);
        if is_stable(middle) { below = middle } else { above = middle }
    }
    below
}

#[cfg(test)]
mod tests {
    use super::*;

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
