//! How a torque gets from one command to the next.

/// The course of a torque, and of its echo, from where it was to its command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Course {
    /// A lag of first order with this time constant, s.
    Lag(f64),
    /// A straight line that takes so long, s.
    Ramp(f64),
}

impl Course {
    /// How much of the way is left after so many seconds: 1 at first, then less.
    pub fn rest(self, seconds: f64) -> f64 {
        match self {
            Self::Lag(constant) => (-seconds / constant).exp(),
            Self::Ramp(duration) if seconds < duration => 1.0 - seconds / duration,
            Self::Ramp(_) => 0.0,
        }
    }

    /// ∫ of that over the first so many seconds, s.
    pub fn integral(self, seconds: f64) -> f64 {
        match self {
            Self::Lag(constant) => constant * (1.0 - (-seconds / constant).exp()),
            Self::Ramp(duration) => {
                let on_the_way = seconds.min(duration);
                if duration == 0.0 { 0.0 } else { on_the_way * (1.0 - on_the_way / duration / 2.0) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_integral_is_that_of_the_rest() {
        for course in [Course::Lag(0.02), Course::Ramp(0.03), Course::Ramp(0.0)] {
            for end in [0.005, 0.03, 0.1_f64] {
                // By the midpoint rule, whose error is of second order.
                let step = end / 20_000.0;
                let middles = (0..20_000).map(|i| (f64::from(i) + 0.5) * step);
                let sum: f64 = middles.map(|at| course.rest(at) * step).sum();
                assert!((course.integral(end) - sum).abs() < 1e-8, "{course:?} {end}");
            }
        }
    }
}
