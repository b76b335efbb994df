//! Scenarios of one structure as one arm, one trajectory and one law, whose numbers have lanes.

use mtj_controller::{
    law::Factor,
    responder::{Law, Responder},
};
use mtj_model::{
    PLANE,
    arm::{Link, PlanarArm},
    gains::Gains,
    lanes::Lanes,
    scenario::Scenario,
    trajectory::{Circle, PointToPoint, Ripple, Trajectory},
};
use nalgebra::{SMatrix, SVector, Vector2};

/// The scenarios side by side, one for each lane.
pub struct Uniform<'a, 's>(pub &'a [&'s Scenario]);

impl Uniform<'_, '_> {
    /// One of their numbers.
    fn each<T: Lanes>(&self, number: impl Fn(&Scenario) -> f64) -> T {
        let mut all = T::zero();
        for (lane, scenario) in self.0.iter().enumerate() {
            all.set(lane, number(scenario));
        }
        all
    }

    /// The arms, with masses as they are or, `scaled`, as a model knows them.
    pub fn arm<T: Lanes, const N: usize>(&self, scaled: bool) -> PlanarArm<T, N> {
        let scale = |s: &Scenario| if scaled { s.law.mass_scale } else { 1.0 };
        let links = std::array::from_fn(|i| Link {
            length: self.each(|s| s.arm.links[i].length),
            mass: self.each(|s| s.arm.links[i].mass * scale(s)),
            center: self.each(|s| s.arm.links[i].center),
            inertia: self.each(|s| s.arm.links[i].inertia * scale(s)),
        });
        PlanarArm::new(&links, self.vector(|s| s.arm.gravity))
    }

    /// What their controllers are made of.
    pub fn responder<T: Lanes, const N: usize>(&self) -> Responder<T, N> {
        Responder { arm: self.arm(true), trajectory: self.trajectory(), law: self.law() }
    }

    fn vector<T: Lanes>(&self, vector: impl Fn(&Scenario) -> Vector2<f64>) -> Vector2<T> {
        Vector2::new(self.each(|s| vector(s).x), self.each(|s| vector(s).y))
    }

    fn trajectory<T: Lanes>(&self) -> Trajectory<T> {
        match self.0[0].trajectory {
            Trajectory::Circle(_) => Trajectory::Circle(self.circle()),
            Trajectory::PerturbedCircle(..) => {
                let ripple = |of: fn(Ripple<f64>) -> f64| {
                    self.each(|s| match s.trajectory {
                        Trajectory::PerturbedCircle(_, ripple) => of(ripple),
                        _ => f64::NAN,
                    })
                };
                let ripple =
                    Ripple { amplitude: ripple(|r| r.amplitude), multiple: ripple(|r| r.multiple) };
                Trajectory::PerturbedCircle(self.circle(), ripple)
            }
            Trajectory::PointToPoint(_) => {
                let line = |of: fn(PointToPoint<f64>) -> f64| {
                    self.each(|s| match s.trajectory {
                        Trajectory::PointToPoint(line) => of(line),
                        _ => f64::NAN,
                    })
                };
                Trajectory::PointToPoint(PointToPoint {
                    from: Vector2::new(line(|l| l.from.x), line(|l| l.from.y)),
                    to: Vector2::new(line(|l| l.to.x), line(|l| l.to.y)),
                    duration: line(|l| l.duration),
                })
            }
        }
    }

    fn circle<T: Lanes>(&self) -> Circle<T> {
        let circle = |of: fn(Circle<f64>) -> f64| {
            self.each(|s| match s.trajectory {
                Trajectory::Circle(circle) | Trajectory::PerturbedCircle(circle, _) => of(circle),
                Trajectory::PointToPoint(_) => f64::NAN,
            })
        };
        Circle {
            center: Vector2::new(circle(|c| c.center.x), circle(|c| c.center.y)),
            radius: circle(|c| c.radius),
            angular_frequency: circle(|c| c.angular_frequency),
            phase: circle(|c| c.phase),
        }
    }

    fn law<T: Lanes>(&self) -> Law<T> {
        let law = &self.0[0].law;
        let error = SVector::from_fn(|i, _| self.each(|s| s.law.factor.error[i]));
        let error_rate = SVector::from_fn(|i, _| self.each(|s| s.law.factor.error_rate[i]));
        Law::new(
            law.kind,
            self.gains(|s| &s.law.kp),
            self.gains(|s| &s.law.kd),
            Factor::new(law.factor.kind, error, error_rate),
            (law.factor.ceiling != 1.0).then(|| self.each(|s| s.law.factor.ceiling)),
            law.acceleration,
        )
    }

    fn gains<T: Lanes>(&self, of: fn(&Scenario) -> &Gains<f64, PLANE>) -> Gains<T, PLANE> {
        match of(self.0[0]) {
            Gains::Diagonal(_) => {
                Gains::Diagonal(SVector::from_fn(|i, _| self.each(|s| of(s).matrix()[(i, i)])))
            }
            Gains::Full(_) => {
                Gains::Full(SMatrix::from_fn(|i, j| self.each(|s| of(s).matrix()[(i, j)])))
            }
        }
    }
}
