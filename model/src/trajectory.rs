//! Desired motions of the tip.

use nalgebra::{SVector, Vector2};

use crate::{lift, scalar::Scalar, spline::Spline, transition::Transition};

/// A desired point with its first and second derivatives, for a task whose points are `P`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion<T, P, const M: usize> {
    /// The point, m.
    pub point: P,
    /// m/s.
    pub velocity: SVector<T, M>,
    /// m/s².
    pub acceleration: SVector<T, M>,
}

/// A desired motion in the plane, with exact derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory<T> {
    /// Where it leads.
    pub path: Path<T>,
    /// How it came from the motion before, if it was changed while the loop ran.
    pub transition: Option<Transition<T>>,
}

/// A path in the plane over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Path<T> {
    /// A [`Circle`] with a [`Ripple`]: the paper's eq. (18).
    PerturbedCircle(Circle<T>, Ripple<T>),
    /// A plain circle.
    Circle(Circle<T>),
    /// From one point to another, at rest at both.
    PointToPoint(PointToPoint<T>),
    /// Through given points.
    Points(Spline),
}

/// center + radius (cos(ωt + phase), sin(ωt + phase)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle<T> {
    /// m.
    pub center: Vector2<T>,
    /// m.
    pub radius: T,
    /// ω, rad/s.
    pub angular_frequency: T,
    /// rad.
    pub phase: T,
}

/// amplitude · sin(multiple · ωt), added to both axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple<T> {
    /// m.
    pub amplitude: T,
    /// Ripples a turn; 5 in the paper.
    pub multiple: T,
}

/// A straight line with the quintic time law 10 s³ − 15 s⁴ + 6 s⁵, s = t / duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointToPoint<T> {
    /// m.
    pub from: Vector2<T>,
    /// m.
    pub to: Vector2<T>,
    /// s; afterwards the motion rests at `to`.
    pub duration: T,
}

/// A motion in the plane.
type PlaneMotion<T> = Motion<T, Vector2<T>, 2>;

impl<T> From<Path<T>> for Trajectory<T> {
    fn from(path: Path<T>) -> Self {
        Self { path, transition: None }
    }
}

impl<T: Scalar> Trajectory<T> {
    /// The desired motion at `time` seconds, in a task whose points are positions: its first axes
    /// are those of the plane, and any other rests at zero.
    #[inline(always)]
    pub fn at<const M: usize>(&self, time: T) -> Motion<T, SVector<T, M>, M> {
        let Motion { point, velocity, acceleration } = self.in_plane(time);
        Motion {
            point: first_axes(&point),
            velocity: first_axes(&velocity),
            acceleration: first_axes(&acceleration),
        }
    }

    #[inline(always)]
    fn in_plane(&self, time: T) -> PlaneMotion<T> {
        match &self.transition {
            None => self.path.at(time),
            Some(transition) => {
                let mut motion = self.path.at(time - transition.shift);
                let [point, velocity, acceleration] = transition.rest(time);
                motion.point += point;
                motion.velocity += velocity;
                motion.acceleration += acceleration;
                motion
            }
        }
    }
}

impl<T: Scalar> Path<T> {
    /// The motion along it at `time` seconds.
    #[inline(always)]
    fn at(&self, time: T) -> PlaneMotion<T> {
        match self {
            Self::Circle(circle) => circle.at(time),
            Self::PerturbedCircle(circle, ripple) => {
                let mut motion = circle.at(time);
                let rate = ripple.multiple * circle.angular_frequency;
                let (sin, cos) = (rate * time).sin_cos();
                let swing = ripple.amplitude * rate;
                let both = |value: T| Vector2::new(value, value);
                motion.point += both(ripple.amplitude * sin);
                motion.velocity += both(swing * cos);
                motion.acceleration -= both(swing * rate * sin);
                motion
            }
            Self::PointToPoint(line) => line.at(time),
            Self::Points(spline) => {
                let [x, y, x_dot, y_dot, x_ddot, y_ddot] = time.look_up(|time| spline.at(time));
                Motion {
                    point: Vector2::new(x, y),
                    velocity: Vector2::new(x_dot, y_dot),
                    acceleration: Vector2::new(x_ddot, y_ddot),
                }
            }
        }
    }
}

impl Trajectory<f64> {
    /// This path as the one that follows another motion at `time`, s, without a jump of point,
    /// velocity or acceleration; the way from the one to the other takes `duration`, s.
    ///
    /// A circle after a circle goes on at the same angle; any other path begins when it is set.
    pub fn following(&self, before: &Self, time: f64, duration: f64) -> Self {
        let path = self.path;
        if path == before.path {
            return *before;
        }
        let since = time - before.transition.map_or(0.0, |transition| transition.shift);
        let shift = match (before.path.angular_frequency(), path.angular_frequency()) {
            (Some(was), Some(is)) if is != 0.0 => time - was * since / is,
            _ => time,
        };
        let (from, to) = (before.in_plane(time), path.at(time - shift));
        let offset = [
            from.point - to.point,
            from.velocity - to.velocity,
            from.acceleration - to.acceleration,
        ];
        Self { path, transition: Some(Transition { begin: time, duration, shift, offset }) }
    }
}

impl Path<f64> {
    /// Of a circle, rad/s.
    fn angular_frequency(&self) -> Option<f64> {
        match self {
            Self::Circle(circle) | Self::PerturbedCircle(circle, _) => {
                Some(circle.angular_frequency)
            }
            _ => None,
        }
    }

    /// Bounds of the distance from the base that the motion keeps, m: it comes no closer than the
    /// first and goes no farther than the second.
    pub fn distances(&self) -> (f64, f64) {
        let of = |circle: &Circle<f64>, ripple: f64| {
            let center = circle.center.norm();
            let closest = (center - circle.radius.abs()).abs() - ripple;
            (closest.max(0.0), center + circle.radius.abs() + ripple)
        };
        match self {
            Self::Circle(circle) => of(circle, 0.0),
            // Both axes swing together.
            Self::PerturbedCircle(circle, ripple) => {
                of(circle, ripple.amplitude.abs() * std::f64::consts::SQRT_2)
            }
            // A line comes no closer than to its middle by half its length.
            Self::PointToPoint(line) => {
                let (from, to) = (line.from.norm(), line.to.norm());
                let closest =
                    ((line.from + line.to) / 2.0).norm() - (line.to - line.from).norm() / 2.0;
                (closest.max(0.0), from.max(to))
            }
            // Between its points it may swing anywhere.
            Self::Points(_) => (0.0, f64::INFINITY),
        }
    }
}

impl<T: Scalar> Circle<T> {
    #[inline(always)]
    fn at(&self, time: T) -> PlaneMotion<T> {
        let rate = self.angular_frequency;
        let (sin, cos) = (rate * time + self.phase).sin_cos();
        let spoke = Vector2::new(cos, sin) * self.radius;
        Motion {
            point: self.center + spoke,
            velocity: Vector2::new(-spoke.y, spoke.x) * rate,
            acceleration: spoke * -(rate * rate),
        }
    }
}

impl<T: Scalar> PointToPoint<T> {
    #[inline(always)]
    fn at(&self, time: T) -> PlaneMotion<T> {
        let c = T::constant;
        let s = time / self.duration;
        let way = self.to - self.from;
        let rest = T::one() - s;
        let rate = T::one() / self.duration;
        let (zero, one) = (T::zero(), T::one());
        // At rest before the beginning and from the end on.
        let moving = |value: T, at_end: T| {
            let so_far = s.where_below(one, value, at_end);
            zero.where_below(s, so_far, zero)
        };
        let part = moving(s * s * s * (c(10.0) - s * (c(15.0) - c(6.0) * s)), one);
        let speed = moving(c(30.0) * s * s * rest * rest * rate, zero);
        let change = moving(c(60.0) * s * rest * (one - c(2.0) * s) * rate * rate, zero);
        let arrived = |arrived: T, under_way: T| s.where_below(one, under_way, arrived);
        let there = self.from + way * part;
        Motion {
            point: Vector2::new(arrived(self.to.x, there.x), arrived(self.to.y, there.y)),
            velocity: way * speed,
            acceleration: way * change,
        }
    }
}

#[inline(always)]
fn first_axes<T: Scalar, const M: usize>(plane: &Vector2<T>) -> SVector<T, M> {
    let mut axes = SVector::zeros();
    for i in 0..M.min(2) {
        axes[i] = plane[i];
    }
    axes
}

lift! {
    enum Path<T> {
        PerturbedCircle(circle, ripple),
        Circle(circle),
        PointToPoint(line),
        Points(spline),
    }
}
lift! { struct Trajectory<T> { path, transition } }
lift! { struct Circle<T> { center, radius, angular_frequency, phase } }
lift! { struct Ripple<T> { amplitude, multiple } }
lift! { struct PointToPoint<T> { from, to, duration } }

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> [Trajectory<f64>; 3] {
        let circle = Circle {
            center: Vector2::new(0.1, -0.2),
            radius: 2f64.sqrt(),
            angular_frequency: 1.3,
            phase: std::f64::consts::FRAC_PI_4,
        };
        [
            Path::PerturbedCircle(circle, Ripple { amplitude: 0.1, multiple: 5.0 }).into(),
            Path::Circle(circle).into(),
            Path::PointToPoint(PointToPoint {
                from: Vector2::new(1.0, 0.5),
                to: Vector2::new(0.2, 1.4),
                duration: 2.0,
            })
            .into(),
        ]
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        let h = 1e-5;
        for trajectory in all() {
            for i in 0..50 {
                let t = 0.037 + 0.05 * f64::from(i);
                let (before, now, after) =
                    (trajectory.at::<2>(t - h), trajectory.at::<2>(t), trajectory.at::<2>(t + h));
                let velocity = (after.point - before.point) / (2.0 * h);
                let acceleration = (after.velocity - before.velocity) / (2.0 * h);
                assert!((velocity - now.velocity).norm() < 1e-8, "{trajectory:?} at {t}");
                assert!((acceleration - now.acceleration).norm() < 1e-7, "{trajectory:?} at {t}");
            }
        }
    }

    #[test]
    fn the_perturbed_circle_is_eq_18() {
        let (omega, t) = (2.0, 0.77);
        let radius = 2f64.sqrt();
        let circle = Circle {
            center: Vector2::zeros(),
            radius,
            angular_frequency: omega,
            phase: std::f64::consts::FRAC_PI_4,
        };
        let ripple = Ripple { amplitude: 0.1, multiple: 5.0 };
        let at = Trajectory::from(Path::PerturbedCircle(circle, ripple)).at::<2>(t);
        let angle = omega * t + std::f64::consts::FRAC_PI_4;
        let ripple = 0.1 * (5.0 * omega * t).sin();
        assert!((at.point.x - (radius * angle.cos() + ripple)).abs() < 1e-14);
        assert!((at.point.y - (radius * angle.sin() + ripple)).abs() < 1e-14);
    }

    #[test]
    fn a_point_to_point_motion_starts_and_ends_at_rest() {
        let line = all()[2];
        for (t, x) in [(-1.0, 1.0), (0.0, 1.0), (2.0, 0.2), (9.0, 0.2)] {
            let at = line.at::<2>(t);
            assert_eq!((at.point.x, at.velocity.norm(), at.acceleration.norm()), (x, 0.0, 0.0));
        }
    }

    #[test]
    fn a_motion_follows_another_without_a_jump_of_point_velocity_or_acceleration() {
        for before in all() {
            for after in all().into_iter().filter(|after| after.path != before.path) {
                let (time, h) = (1.234, 1e-7);
                let changed = after.following(&before, time, 0.5);
                let (was, is) = (before.at::<2>(time), changed.at::<2>(time));
                assert!((was.point - is.point).norm() < 1e-12, "{before:?} {after:?}");
                assert!((was.velocity - is.velocity).norm() < 1e-12);
                assert!((was.acceleration - is.acceleration).norm() < 1e-11);
                let shift = changed.transition.unwrap().shift;
                let (end, of_path) = (changed.at::<2>(time + 0.5), after.at(time + 0.5 - shift));
                assert!((end.point - of_path.point).norm() < 1e-12);
                assert!((end.velocity - of_path.velocity).norm() < 1e-12);
                assert!((end.acceleration - of_path.acceleration).norm() < 1e-11);
                for i in 1..10 {
                    let t = time + 0.0517 * f64::from(i);
                    let [early, now, late] = [t - h, t, t + h].map(|time| changed.at::<2>(time));
                    let velocity = (late.point - early.point) / (2.0 * h);
                    let acceleration = (late.velocity - early.velocity) / (2.0 * h);
                    assert!((velocity - now.velocity).norm() < 1e-6, "{changed:?} at {t}");
                    assert!((acceleration - now.acceleration).norm() < 1e-5, "{changed:?} at {t}");
                }
                // Changed again on the way, and changed in something else.
                let again = before.following(&changed, time + 0.2, 0.5);
                let (was, is) = (changed.at::<2>(time + 0.2), again.at::<2>(time + 0.2));
                assert!((was.point - is.point).norm() < 1e-12);
                assert!((was.acceleration - is.acceleration).norm() < 1e-11);
                assert_eq!(after.following(&changed, time + 0.2, 0.5), changed);
            }
        }
    }

    #[test]
    fn a_circle_that_turns_faster_goes_on_at_its_angle_and_another_motion_from_its_beginning() {
        let Path::Circle(circle) = all()[1].path else { panic!() };
        let faster = Path::Circle(Circle { angular_frequency: 2.6, ..circle });
        let changed = Trajectory::from(faster).following(&all()[1], 3.0, 1.0);
        let angle = |time: f64| {
            let spoke = changed.at::<2>(time).point - circle.center;
            spoke.y.atan2(spoke.x)
        };
        let expected = circle.phase + 1.3 * 3.0 + 2.6 * 2.0;
        let difference = angle(5.0) - expected;
        assert!(difference.sin().abs() < 1e-12 && difference.cos() > 0.0);
        let line = all()[2].following(&all()[1], 3.0, 0.5);
        assert_eq!(line.at::<2>(4.0).point, all()[2].at::<2>(1.0).point, "half of the way");
    }
}
