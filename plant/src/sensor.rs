//! The sensor: measured angles and velocities.

use std::f64::consts::PI;

use mtj_model::scenario::{EncoderSettings, Scenario};
use mtj_protocol::sample::{Joints, padded};
use rand_pcg::{Pcg64, rand_core::Rng};

/// Measures joint angles and velocities under white noise, and with encoders of finite resolution.
///
/// The noise of each output is uniform within ± `noise` times its magnitude, as "white noise whose
/// amplitude is 2 % of the output's magnitude" has it; an angle's magnitude is that of the angle
/// taken in (−π, π].
#[derive(Clone, Debug)]
pub struct Sensor {
    noise: f64,
    encoder: Option<Encoder>,
    random: Pcg64,
}

/// Encoders of finite resolution, of which velocities may be differences.
#[derive(Clone, Copy, Debug)]
struct Encoder {
    /// rad; 0 for exact angles.
    resolution: Joints,
    differentiates: bool,
    /// Time constant of the filter of the velocities, s.
    filter: f64,
    /// The last measurement.
    last: Option<Measurement>,
}

#[derive(Clone, Copy, Debug)]
struct Measurement {
    time_ns: u64,
    position: Joints,
    velocity: Joints,
}

/// Keeps the sensor's random numbers apart from those of other parts with the same seed.
const STREAM: u128 = 1;

impl Sensor {
    /// The sensor of a scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            noise: scenario.noise,
            encoder: scenario.encoder.as_ref().map(Encoder::new),
            random: Pcg64::new(u128::from(scenario.seed), STREAM),
        }
    }

    /// Whether a scenario's measurements differ from the truth.
    pub fn is_imperfect(scenario: &Scenario) -> bool {
        scenario.noise > 0.0 || scenario.encoder.is_some()
    }

    /// Takes noise and encoders from a changed scenario; what was measured last stays known.
    pub fn reconfigure(&mut self, scenario: &Scenario) {
        let last = self.encoder.and_then(|encoder| encoder.last);
        self.noise = scenario.noise;
        self.encoder =
            scenario.encoder.as_ref().map(|settings| Encoder { last, ..Encoder::new(settings) });
    }

    /// Angles and velocities as measured at `time_ns`.
    pub fn measure(
        &mut self,
        time_ns: u64,
        position: Joints,
        velocity: Joints,
    ) -> (Joints, Joints) {
        let (mut position, mut velocity) = (position, velocity);
        if self.noise != 0.0 {
            position = position.map(|angle| angle + self.error(wrapped(angle)));
            velocity = velocity.map(|rate| rate + self.error(rate));
        }
        match &mut self.encoder {
            None => (position, velocity),
            Some(encoder) => encoder.measure(time_ns, position, velocity),
        }
    }

    fn error(&mut self, output: f64) -> f64 {
        self.noise * output.abs() * (2.0 * fraction(&mut self.random) - 1.0)
    }
}

impl Encoder {
    fn new(settings: &EncoderSettings) -> Self {
        Self {
            resolution: padded(&settings.resolution),
            differentiates: settings.differentiates,
            filter: settings.filter.as_secs_f64(),
            last: None,
        }
    }

    /// What the encoders make of angles and velocities. The first velocities are as they are: the
    /// encoders were there before the run.
    fn measure(&mut self, time_ns: u64, position: Joints, velocity: Joints) -> (Joints, Joints) {
        let (mut position, mut velocity) = (position, velocity);
        for (angle, step) in position.iter_mut().zip(self.resolution) {
            if step > 0.0 {
                *angle = (*angle / step).round() * step;
            }
        }
        if let Some(last) = &self.last
            && time_ns > last.time_ns
        {
            let interval = (time_ns - last.time_ns) as f64 * 1e-9;
            if self.differentiates {
                velocity = std::array::from_fn(|i| (position[i] - last.position[i]) / interval);
            }
            // Backward Euler of filter · dv/dt = input − v: stable whatever the interval.
            let part = interval / (self.filter + interval);
            velocity =
                std::array::from_fn(|i| last.velocity[i] + part * (velocity[i] - last.velocity[i]));
        }
        self.last = Some(Measurement { time_ns, position, velocity });
        (position, velocity)
    }
}

/// A random number in [0, 1): the upper 53 bits of 64.
pub(crate) fn fraction(random: &mut Pcg64) -> f64 {
    (random.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
}

/// The same direction in (−π, π].
fn wrapped(angle: f64) -> f64 {
    let turn = 2.0 * PI;
    let back = PI - angle;
    // A division, which is slow, only where it does something.
    PI - if (0.0..turn).contains(&back) { back } else { back.rem_euclid(turn) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_taken_within_half_a_turn() {
        for (angle, expected) in
            [(0.5, 0.5), (PI, PI), (-PI, PI), (7.0, 7.0 - 2.0 * PI), (-4.0, 2.0 * PI - 4.0)]
        {
            assert!((wrapped(angle) - expected).abs() < 1e-12, "{angle}");
        }
    }

    fn sensor(sets: &[&str]) -> Sensor {
        let sets: Vec<_> = sets.iter().map(|set| set.parse().unwrap()).collect();
        Sensor::new(&Scenario::load("sampled/mtj", &sets).unwrap())
    }

    #[test]
    fn an_encoder_measures_whole_steps_and_differences_of_them() {
        let mut sensor =
            sensor(&["encoder.resolution=[0.1, 0.0]", "encoder.velocity=differentiated"]);
        let at = |angle: f64| padded(&[angle, angle]);
        let (position, velocity) = sensor.measure(0, at(0.26), at(5.0));
        assert!((position[0] - 0.3).abs() < 1e-15 && position[1] == 0.26, "{position:?}");
        assert_eq!(velocity[..2], [5.0, 5.0], "the first as it is");
        // 0.3 to 0.2 and 0.26 to 0.24 in 10 ms.
        let (position, velocity) = sensor.measure(10_000_000, at(0.24), at(5.0));
        assert!((position[0] - 0.2).abs() < 1e-15);
        assert!((velocity[0] + 10.0).abs() < 1e-12 && (velocity[1] + 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_filter_follows_a_step_of_the_velocity_as_one_of_first_order_does() {
        // Backward Euler: 1 − (1 + T/τ)⁻ⁿ, which is 1 − exp(−t/τ) for short periods.
        let mut sensor = sensor(&["encoder.filter=50ms"]);
        sensor.measure(0, [0.0; 7], [0.0; 7]);
        for n in 1..2000_i32 {
            let (_, velocity) = sensor.measure(100_000 * n as u64, [0.0; 7], [1.0; 7]);
            let exact = 1.0 - (1.0 + 0.1 / 50.0_f64).powi(-n);
            assert!((velocity[0] - exact).abs() < 1e-12);
            assert!((velocity[0] - (1.0 - (-0.002 * f64::from(n)).exp())).abs() < 1e-3);
        }
    }

    #[test]
    fn noise_is_uniform_within_a_fraction_of_the_magnitude_and_repeatable() {
        let (position, velocity) = ([2.0; 7], [-3.0; 7]);
        let mut sensor = sensor(&["sensor.noise=0.02", "seed=5"]);
        let mut twin = sensor.clone();
        let (mut largest, mut sum, mut squares) = (0.0_f64, 0.0, 0.0);
        for _ in 0..20_000 {
            let measured = sensor.measure(0, position, velocity);
            assert_eq!(measured, twin.measure(0, position, velocity));
            let error = (measured.1[0] + 3.0) / (0.02 * 3.0);
            largest = largest.max(error.abs());
            sum += error;
            squares += error * error;
        }
        assert!((0.999..=1.0).contains(&largest));
        assert!((sum / 20_000.0).abs() < 0.02);
        assert!((squares / 20_000.0 - 1.0 / 3.0).abs() < 0.01, "the variance of a uniform error");
    }
}
