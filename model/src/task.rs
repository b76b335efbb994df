//! Tasks: what of the tip is controlled, and the tracking error.
//!
//! A task is known by the type of its points. [`Task`] is the only place that knows how to compare
//! two points and how to move one, so that an orientation need not be a vector. The tracking error
//! is computed here and nowhere else.
//!
//! # A task of one's own
//!
//! A direction in the plane. Two directions differ by at most half a turn, which a plain difference
//! of angles would miss:
//!
//! ```
//! use std::f64::consts::{PI, TAU};
//!
//! use mtj_model::{
//!     task::{Task, Tip, TrackingError},
//!     trajectory::{Motion, Trajectory},
//! };
//! use nalgebra::{SVector, Vector1};
//!
//! /// An angle, rad, in (−π, π].
//! #[derive(Clone, Copy, Debug, PartialEq)]
//! struct Direction(f64);
//!
//! impl Direction {
//!     fn new(angle: f64) -> Self {
//!         Self(PI - (PI - angle).rem_euclid(TAU))
//!     }
//! }
//!
//! impl Task<f64, 1> for Direction {
//!     fn difference(desired: &Self, actual: &Self) -> SVector<f64, 1> {
//!         Vector1::new(Self::new(desired.0 - actual.0).0)
//!     }
//!     fn integrate(&self, step: &SVector<f64, 1>) -> Self {
//!         Self::new(self.0 + step.x)
//!     }
//!     fn desired(trajectory: &Trajectory<f64>, time: f64) -> Motion<f64, Self, 1> {
//!         // The x of a trajectory, taken as an angle.
//!         let Motion { point, velocity, acceleration } = trajectory.at::<1>(time);
//!         Motion { point: Self::new(point.x), velocity, acceleration }
//!     }
//! }
//!
//! let zero = Vector1::zeros();
//! let desired = Motion { point: Direction(3.0), velocity: zero, acceleration: zero };
//! let tip = Tip { time: 0.0, point: Direction(-3.0), velocity: zero };
//! let error = TrackingError::between(&desired, &tip);
//! assert!((error.position.x - (6.0 - TAU)).abs() < 1e-12, "the short way round");
//! assert_eq!(tip.point.integrate(&error.position), desired.point);
//! ```

use nalgebra::SVector;

use crate::{
    scalar::Scalar,
    trajectory::{Motion, Trajectory},
};

/// A task with `M` axes; implemented by the type of its points.
pub trait Task<T: Scalar, const M: usize>: Copy {
    /// desired ⊖ actual, one number an axis.
    fn difference(desired: &Self, actual: &Self) -> SVector<T, M>;
    /// The point that is a small `step` along the axes from this one.
    fn integrate(&self, step: &SVector<T, M>) -> Self;
    /// The desired motion at `time`, s.
    fn desired(trajectory: &Trajectory<T>, time: T) -> Motion<T, Self, M>;
}

/// Points that are vectors: positions.
impl<T: Scalar, const M: usize> Task<T, M> for SVector<T, M> {
    #[inline(always)]
    fn difference(desired: &Self, actual: &Self) -> Self {
        desired - actual
    }

    #[inline(always)]
    fn integrate(&self, step: &Self) -> Self {
        self + step
    }

    #[inline(always)]
    fn desired(trajectory: &Trajectory<T>, time: T) -> Motion<T, Self, M> {
        trajectory.at(time)
    }
}

/// Where the tip is at an instant and how it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tip<T, P, const M: usize> {
    /// The instant, s since the run began.
    pub time: T,
    /// The point.
    pub point: P,
    /// Its rate along the axes, m/s.
    pub velocity: SVector<T, M>,
}

impl<T: Scalar, P: Task<T, M>, const M: usize> Tip<T, P, M> {
    /// t_k − t_{k−1} since an earlier sample, s; zero where there was none.
    #[inline(always)]
    pub fn interval_since(&self, previous: &Previous<T, M>) -> T {
        previous.time.where_below(self.time, self.time - previous.time, T::zero())
    }

    /// a = (v_k − v_{k−1})/(t_k − t_{k−1}) since an earlier sample, m/s²; zero where there was
    /// none.
    #[inline(always)]
    pub fn acceleration_since(&self, previous: &Previous<T, M>) -> SVector<T, M> {
        let period = self.time - previous.time;
        let mut acceleration = SVector::zeros();
        for i in 0..M {
            let difference = (self.velocity[i] - previous.velocity[i]) / period;
            acceleration[i] = previous.time.where_below(self.time, difference, T::zero());
        }
        acceleration
    }
}

/// The tip at the sample before: its time and velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Previous<T, const M: usize> {
    /// s; infinite if there was none, so that lanes need no branch.
    pub time: T,
    /// m/s.
    pub velocity: SVector<T, M>,
}

impl<T: Scalar, const M: usize> Previous<T, M> {
    /// Before the first sample.
    pub fn none() -> Self {
        Self { time: T::constant(f64::INFINITY), velocity: SVector::zeros() }
    }
}

/// How far the tip is from where it should be, eq. (6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackingError<T, const M: usize> {
    /// e = desired ⊖ actual, m.
    pub position: SVector<T, M>,
    /// ė, m/s.
    pub velocity: SVector<T, M>,
}

impl<T: Scalar, const M: usize> TrackingError<T, M> {
    /// The error of a tip against a desired motion.
    #[inline(always)]
    pub fn between<P: Task<T, M>>(desired: &Motion<T, P, M>, tip: &Tip<T, P, M>) -> Self {
        Self {
            position: P::difference(&desired.point, &tip.point),
            velocity: desired.velocity - tip.velocity,
        }
    }
}

/// The description of a task.
#[derive(Debug, PartialEq)]
pub struct Description {
    /// The name in scenarios.
    pub name: &'static str,
    /// Its axes in the order of every list that has one number for each.
    pub axes: &'static [Axis],
}

/// One axis of a task.
#[derive(Debug, PartialEq)]
pub struct Axis {
    /// The name in print.
    pub name: &'static str,
    /// The unit of a position along it.
    pub unit: &'static str,
}

/// The registry of tasks.
pub const TASKS: [Description; 1] = [Description {
    name: "plane",
    axes: &[Axis { name: "x", unit: "m" }, Axis { name: "y", unit: "m" }],
}];

/// Evaluates an expression with the constant `$M` bound to the number of axes of a task.
///
/// `for_axes!(scenario.task, M => controller::<M>(scenario))`
#[macro_export]
macro_rules! for_axes {
    ($task:expr, $M:ident => $body:expr) => {{
        debug_assert_eq!($task.axes.len(), 2, "the plane is the only task");
        const $M: usize = 2;
        $body
    }};
}
