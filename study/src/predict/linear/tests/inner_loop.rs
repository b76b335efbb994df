//! The inner loop of time-delay control: how a force depends on those before it, where no error
//! acts.

use super::*;

/// The matrix by which the forces of a loop without gains follow from those before.
///
/// Of the state it keeps Δ = v − v_before, the echo and the forces: the position and the velocity
/// itself then have no effect.
fn force_map(inner: &LinearLoop<1>) -> DMatrix<f64> {
    let matrix = inner.step_matrix();
    let size = matrix.nrows() - 2;
    DMatrix::from_fn(size, size, |i, j| {
        let row = if i == 0 { 1 } else { i + 2 };
        if j == 0 { -matrix[(row, 2)] } else { matrix[(row, j + 2)] }
    })
}

fn radius(mass_ratio: f64, memory: MemoryPolicy, latency: f64) -> f64 {
    let inner = held::<1>(tdc(0.0, 0.0, mass_ratio * 2.0), 2.0, memory, latency);
    force_map(&inner).complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max)
}

#[test]
fn delivered_is_stable_for_a_mass_below_twice_the_tips_at_any_latency() {
    for latency in (0..120).map(|i| 0.0011 * f64::from(i)).chain(LATENCIES) {
        for ratio in [0.05, 0.5, 1.0, 1.5, 1.95] {
            let radius = radius(ratio, MemoryPolicy::Delivered, latency);
            assert!(radius < 1.0, "{ratio}, {latency} s: {radius}");
        }
    }
}

#[test]
fn delivered_is_unstable_beyond_twice_the_tips_mass_at_any_whole_latency() {
    for n in 0..6 {
        let latency = f64::from(n) * PERIOD;
        // F_k = (1 − M̄/m) F_{k−n−1}.
        let expected = 1.05_f64.powf(1.0 / f64::from(n + 1));
        let radius = radius(2.05, MemoryPolicy::Delivered, latency);
        assert!((radius - expected).abs() < 1e-9, "{n}: {radius} for {expected}");
    }
}

#[test]
fn sent_is_stable_below_its_limit() {
    for n in 0..6_u32 {
        let latency = f64::from(n) * PERIOD;
        let is_stable = |ratio: f64| radius(ratio, MemoryPolicy::Sent, latency) < 1.0;
        let limit = close_in(0.01, 3.0, is_stable);
        let stated = 2.0 * (std::f64::consts::PI / f64::from(4 * n + 2)).sin();
        assert!((limit - stated).abs() < 1e-6, "{n}: {limit} for {stated}");
    }
}

/// A mass under a held force, whose commands come late, come out of order, or do not come at all.
struct Network {
    inner: LinearLoop<1>,
    random: u64,
    /// Arrival, s, number and force of each command on its way.
    on_their_way: Vec<(f64, usize, f64)>,
    /// Number and force of the command in effect.
    held: (usize, f64),
}

impl Network {
    fn new(mass_ratio: f64, memory: MemoryPolicy) -> Self {
        let inner = held::<1>(tdc(0.0, 0.0, mass_ratio * 2.0), 2.0, memory, 0.0);
        Self { inner, random: 1, on_their_way: Vec::new(), held: (0, 0.0) }
    }

    /// A number from 0 to 1.
    fn draw(&mut self) -> f64 {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Sends a command at time 0 and holds what is in effect for a period: the mean force, and the
    /// largest of them.
    fn hold(&mut self, number: usize, force: f64) -> (f64, f64) {
        if self.draw() < 0.7 {
            let latency = 5.0 * PERIOD * self.draw();
            self.on_their_way.push((latency, number, force));
        }
        self.on_their_way.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut now, mut impulse, mut largest) = (0.0, 0.0, 0.0_f64);
        let mut hold = |held: f64, until: f64| {
            impulse += held * (until - now);
            largest = largest.max(held.abs());
            now = until;
        };
        for (arrival, number, force) in self.on_their_way.iter().filter(|it| it.0 < PERIOD) {
            hold(self.held.1, *arrival);
            // The newest command wins.
            if *number > self.held.0 {
                self.held = (*number, *force);
            }
        }
        hold(self.held.1, PERIOD);
        self.on_their_way.retain(|it| it.0 >= PERIOD);
        self.on_their_way.iter_mut().for_each(|it| it.0 -= PERIOD);
        (impulse / PERIOD, largest)
    }

    /// Runs so many periods from a force of 1 N: for each the law's answer, and the largest force
    /// that acted before it.
    fn run(mut self, periods: usize) -> Vec<(f64, f64)> {
        let scalar = |x: f64| SVector::<f64, 1>::repeat(x);
        let (mut v, mut force) = (0.0, 1.0);
        self.held.1 = force;
        let mut answers = Vec::new();
        for number in 1..=periods {
            let (mean, largest) = self.hold(number, force);
            let v_before = v;
            v += mean * PERIOD / self.inner.mass;
            force = self.inner.force(&State {
                x: scalar(0.0),
                v: scalar(v),
                v_before: scalar(v_before),
                echoed: scalar(mean),
                forces: &[force],
            })[0];
            answers.push((force, largest));
        }
        answers
    }
}

#[test]
fn delivered_contracts_under_any_jitter_and_loss() {
    for ratio in [0.2, 0.9, 1.0, 1.1, 1.8] {
        let answers = Network::new(ratio, MemoryPolicy::Delivered).run(2000);
        for (force, largest) in &answers {
            let bound = (1.0 - ratio).abs() * largest + 1e-9;
            assert!(force.abs() <= bound, "{ratio}: {force} after {largest}");
        }
        let (last, _) = answers[answers.len() - 1];
        assert!(last.abs() < 1e-6, "{ratio}: {last}");
    }
}

#[test]
fn sent_does_not() {
    let answers = Network::new(1.0, MemoryPolicy::Sent).run(2000);
    let largest = answers.iter().fold(0.0_f64, |largest, (force, _)| largest.max(force.abs()));
    assert!(largest > 10.0, "{largest}");
}
