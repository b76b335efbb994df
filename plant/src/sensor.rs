//! The sensor: measured angles and velocities.

use std::f64::consts::PI;

use mtj_protocol::sample::Joints;
use rand_pcg::{Pcg64, rand_core::Rng};

/// Measures joint angles and velocities under white noise.
///
/// The noise of each output is uniform within ± `noise` times its magnitude, as "white noise whose
/// amplitude is 2 % of the output's magnitude" has it; an angle's magnitude is that of the angle
/// taken in (−π, π].
#[derive(Clone, Debug)]
pub struct Sensor {
    noise: f64,
    random: Pcg64,
}

/// Keeps the sensor's random numbers apart from those of other parts with the same seed.
const STREAM: u128 = 1;

impl Sensor {
    /// A sensor with a noise amplitude as a fraction of the output's magnitude.
    pub fn new(noise: f64, seed: u64) -> Self {
        Self { noise, random: Pcg64::new(u128::from(seed), STREAM) }
    }

    /// Changes the amplitude of the noise.
    pub fn set_noise(&mut self, noise: f64) {
        self.noise = noise;
    }

    /// Measured angles and velocities.
    pub fn measure(&mut self, position: Joints, velocity: Joints) -> (Joints, Joints) {
        if self.noise == 0.0 {
            return (position, velocity);
        }
        (
            position.map(|angle| angle + self.error(wrapped(angle))),
            velocity.map(|rate| rate + self.error(rate)),
        )
    }

    fn error(&mut self, output: f64) -> f64 {
        self.noise * output.abs() * (2.0 * fraction(&mut self.random) - 1.0)
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

    #[test]
    fn noise_is_uniform_within_a_fraction_of_the_magnitude_and_repeatable() {
        let (position, velocity) = ([2.0; 7], [-3.0; 7]);
        let mut sensor = Sensor::new(0.02, 5);
        let mut twin = Sensor::new(0.02, 5);
        let (mut largest, mut sum, mut squares) = (0.0_f64, 0.0, 0.0);
        for _ in 0..20_000 {
            let measured = sensor.measure(position, velocity);
            assert_eq!(measured, twin.measure(position, velocity));
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
