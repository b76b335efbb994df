//! A desired motion through given points.

use std::sync::Mutex;

use nalgebra::Vector2;

use crate::{
    lanes::Lanes,
    lift::{Lift, Shape},
    scalar::Scalar,
};

/// A point of a motion with the time at which it is reached, s and m.
pub type TimedPoint = [f64; 3];

/// How the motion goes from point to point. Both are continuous to the second derivative between the
/// first point and the last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Cubic polynomials, at rest at both ends; there the acceleration jumps.
    Cubic,
    /// Quintic polynomials, at rest and without acceleration at both ends.
    Quintic,
}

/// A piecewise polynomial through points: at rest before the first and after the last.
///
/// It is a reference, so that trajectories stay values that can be copied. Motions of a process are
/// kept for as long as it lives; the same points are kept once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spline(&'static Pieces);

#[derive(Debug, PartialEq)]
struct Pieces {
    points: Vec<TimedPoint>,
    order: Order,
    /// For each interval the coefficients of its polynomial in the time since its beginning, the
    /// constant first, for x and y.
    coefficients: Vec<[Vector2<f64>; 6]>,
}

/// All motions of this process.
static KNOWN: Mutex<Vec<&'static Pieces>> = Mutex::new(Vec::new());

impl Spline {
    /// The motion through at least two points at times that rise; `None` otherwise.
    pub fn through(points: &[TimedPoint], order: Order) -> Option<Self> {
        let rises = points.windows(2).all(|pair| pair[0][0] < pair[1][0]);
        if points.len() < 2 || !rises || points.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let mut known = KNOWN.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let same = known.iter().find(|pieces| pieces.points == points && pieces.order == order);
        if let Some(pieces) = same {
            return Some(Self(pieces));
        }
        let coefficients = coefficients(points, order);
        let pieces = Pieces { points: points.to_vec(), order, coefficients };
        let pieces: &'static Pieces = Box::leak(Box::new(pieces));
        known.push(pieces);
        Some(Self(pieces))
    }

    /// The points.
    pub fn points(&self) -> &'static [TimedPoint] {
        &self.0.points
    }

    /// Point, velocity and acceleration at a time, s: x and y of each.
    pub fn at(&self, time: f64) -> [f64; 6] {
        let Pieces { points, coefficients, .. } = self.0;
        let place = |point: &TimedPoint| [point[1], point[2], 0.0, 0.0, 0.0, 0.0];
        // The number of points that were reached; none for a time that is no number.
        match points.partition_point(|point| point[0] <= time) {
            0 => place(&points[0]),
            reached if reached == points.len() => place(&points[reached - 1]),
            reached => {
                let [c0, c1, c2, c3, c4, c5] = coefficients[reached - 1];
                let s = time - points[reached - 1][0];
                let point = c0 + (c1 + (c2 + (c3 + (c4 + c5 * s) * s) * s) * s) * s;
                let velocity =
                    c1 + (c2 * 2.0 + (c3 * 3.0 + (c4 * 4.0 + c5 * (5.0 * s)) * s) * s) * s;
                let acceleration = c2 * 2.0 + (c3 * 6.0 + (c4 * 12.0 + c5 * (20.0 * s)) * s) * s;
                [point.x, point.y, velocity.x, velocity.y, acceleration.x, acceleration.y]
            }
        }
    }
}

/// The coefficients of each interval.
fn coefficients(points: &[TimedPoint], order: Order) -> Vec<[Vector2<f64>; 6]> {
    let place = |i: usize| Vector2::new(points[i][1], points[i][2]);
    let accelerations = clamped_accelerations(points);
    let last = points.len() - 1;
    let velocity = |i: usize| {
        // Of the cubic that ends here, or of the first one, which begins at rest.
        if i == 0 || i == last {
            return Vector2::zeros();
        }
        let h = points[i][0] - points[i - 1][0];
        (place(i) - place(i - 1)) / h + (accelerations[i - 1] + accelerations[i] * 2.0) * (h / 6.0)
    };
    (0..last)
        .map(|i| {
            let h = points[i + 1][0] - points[i][0];
            let (p, q) = (place(i), place(i + 1));
            let (a, b) = (accelerations[i], accelerations[i + 1]);
            let zero = Vector2::zeros();
            match order {
                Order::Cubic => {
                    let v = (q - p) / h - (a * 2.0 + b) * (h / 6.0);
                    [p, v, a / 2.0, (b - a) / (6.0 * h), zero, zero]
                }
                Order::Quintic => {
                    // The same velocities and accelerations at the points, but none at the ends.
                    let a = if i == 0 { zero } else { a };
                    let b = if i + 1 == last { zero } else { b };
                    let (v, w) = (velocity(i), velocity(i + 1));
                    let d = q - p - v * h - a * (h * h / 2.0);
                    let e = w - v - a * h;
                    let f = b - a;
                    [
                        p,
                        v,
                        a / 2.0,
                        d * (10.0 / h.powi(3)) - e * (4.0 / h.powi(2)) + f * (0.5 / h),
                        d * (-15.0 / h.powi(4)) + e * (7.0 / h.powi(3)) - f * (1.0 / h.powi(2)),
                        d * (6.0 / h.powi(5)) - e * (3.0 / h.powi(4)) + f * (0.5 / h.powi(3)),
                    ]
                }
            }
        })
        .collect()
}

/// The second derivatives at the points of the cubic spline that is at rest at both ends: the
/// solution of a tridiagonal system.
fn clamped_accelerations(points: &[TimedPoint]) -> Vec<Vector2<f64>> {
    let last = points.len() - 1;
    let place = |i: usize| Vector2::new(points[i][1], points[i][2]);
    let step = |i: usize| points[i + 1][0] - points[i][0];
    let slope = |i: usize| (place(i + 1) - place(i)) / step(i);
    // Row i: below · m[i−1] + diagonal · m[i] + above · m[i+1] = right.
    let row = |i: usize| -> (f64, f64, f64, Vector2<f64>) {
        if i == 0 {
            (0.0, 2.0 * step(0), step(0), slope(0) * 6.0)
        } else if i == last {
            (step(i - 1), 2.0 * step(i - 1), 0.0, slope(i - 1) * -6.0)
        } else {
            let sum = step(i - 1) + step(i);
            (step(i - 1), 2.0 * sum, step(i), (slope(i) - slope(i - 1)) * 6.0)
        }
    };
    let (mut above, mut right) = (vec![0.0; last + 1], vec![Vector2::zeros(); last + 1]);
    for i in 0..=last {
        let (below, mut diagonal, next, mut value) = row(i);
        if i > 0 {
            diagonal -= below * above[i - 1];
            value -= right[i - 1] * below;
        }
        above[i] = next / diagonal;
        right[i] = value / diagonal;
    }
    for i in (0..last).rev() {
        let next = right[i + 1];
        right[i] -= next * above[i];
    }
    right
}

impl Lift for Spline {
    type In<T: Scalar, const M: usize> = Self;

    /// Only the same motion shares lanes.
    fn shape(&self, shape: &mut Shape) {
        shape.extend(std::ptr::from_ref(self.0).addr().to_le_bytes());
    }
    fn lift<T: Scalar, const M: usize>(&self) -> Self {
        *self
    }
    fn put<T: Lanes, const M: usize>(&self, _: &mut Self, _: usize) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [TimedPoint; 5] =
        [[1.0, 0.5, 1.0], [1.5, 0.7, 0.9], [2.5, 0.6, 1.2], [2.75, 0.9, 1.3], [4.0, 1.0, 1.0]];

    #[test]
    fn a_motion_goes_through_its_points_and_is_continuous_to_the_second_derivative() {
        for order in [Order::Cubic, Order::Quintic] {
            let spline = Spline::through(&POINTS, order).unwrap();
            for (i, [time, x, y]) in POINTS.into_iter().enumerate() {
                let (before, at) = (spline.at(time - 1e-9), spline.at(time));
                assert!((at[0] - x).abs() < 1e-9 && (at[1] - y).abs() < 1e-9, "{at:?}");
                // The cubic's acceleration jumps where it begins and ends.
                let is_end = i == 0 || i == POINTS.len() - 1;
                let continuous = if is_end && order == Order::Cubic { 4 } else { 6 };
                for k in 0..continuous {
                    assert!((at[k] - before[k]).abs() < 1e-5, "{order:?} at {time}, {k}");
                }
            }
            assert_eq!(spline.at(0.0)[..4], [0.5, 1.0, 0.0, 0.0], "at rest before");
            assert_eq!(spline.at(9.0), [1.0, 1.0, 0.0, 0.0, 0.0, 0.0], "at rest after");
        }
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_the_motion() {
        for order in [Order::Cubic, Order::Quintic] {
            let spline = Spline::through(&POINTS, order).unwrap();
            for i in 0..300 {
                let (time, h) = (1.0005 + f64::from(i) * 0.00999, 1e-5);
                let (before, at, after) =
                    (spline.at(time - h), spline.at(time), spline.at(time + h));
                for k in 0..4 {
                    let slope = (after[k] - before[k]) / (2.0 * h);
                    assert!(
                        (slope - at[k + 2]).abs() < 1e-4,
                        "{order:?} at {time}: {slope} {at:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn two_points_are_joined_as_from_point_to_point() {
        // At rest at both ends: 3 s² − 2 s³, and 10 s³ − 15 s⁴ + 6 s⁵.
        let points = [[0.0, 0.0, 1.0], [2.0, 1.0, 1.0]];
        for s in [0.1, 0.5, 0.8_f64] {
            let at = |order| Spline::through(&points, order).unwrap().at(2.0 * s)[0];
            assert!((at(Order::Cubic) - s * s * (3.0 - 2.0 * s)).abs() < 1e-12);
            let quintic = s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s);
            assert!((at(Order::Quintic) - quintic).abs() < 1e-12);
        }
    }

    #[test]
    fn times_that_do_not_rise_make_no_motion() {
        assert_eq!(Spline::through(&POINTS[..1], Order::Cubic), None);
        assert_eq!(Spline::through(&[POINTS[1], POINTS[0]], Order::Cubic), None);
        assert_eq!(Spline::through(&[POINTS[0], [2.0, f64::NAN, 0.0]], Order::Cubic), None);
        let again = Spline::through(&POINTS, Order::Cubic).unwrap();
        assert!(std::ptr::eq(again.0, Spline::through(&POINTS, Order::Cubic).unwrap().0));
    }
}
