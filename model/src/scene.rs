//! The scene that displays draw: the arm, the desired path and the tracking error.
//!
//! Displays compute no kinematics of their own: whatever they draw in space, they ask for here.

use std::f64::consts::TAU;

use nalgebra::SVector;

use crate::{
    MAX_AXES,
    arm::{Kinematics, planar::Configuration},
    for_axes, for_joints,
    matrix::padded,
    scenario::{ArmSettings, Scenario},
    task::{self, Task},
    trajectory::{Path, Trajectory},
};

/// How many points draw the desired path.
const PATH_POINTS: usize = 400;

/// A point in the base frame, m; z is zero in the plane.
pub type Point = [f64; 3];

/// What there is to draw of a scenario.
#[derive(Clone, Debug)]
pub struct Scene {
    arm: ArmSettings,
    trajectory: Trajectory<f64>,
    task: &'static task::Description,
    path: Vec<Point>,
}

impl Scene {
    /// The scene of a scenario.
    pub fn new(scenario: &Scenario) -> Self {
        let trajectory = scenario.trajectory;
        Self {
            arm: scenario.arm.clone(),
            trajectory,
            task: scenario.task,
            path: path(trajectory.path),
        }
    }

    /// What of the tip is controlled, with the names and units of its axes.
    pub fn task(&self) -> &'static task::Description {
        self.task
    }

    /// How many coordinates of a point are in use: 2 in the plane.
    pub fn dimensions(&self) -> usize {
        2
    }

    /// How far the tip can be from the base, m.
    pub fn reach(&self) -> f64 {
        self.arm.reach()
    }

    /// The desired path over one period, or all of it if it comes to rest.
    pub fn path(&self) -> &[Point] {
        &self.path
    }

    /// The points of the arm at joint positions `q`, base first, tip last. Positions that are
    /// missing are taken as zero.
    pub fn points(&self, q: &[f64]) -> Vec<Point> {
        let ends = self.arm.ends(q);
        std::iter::once([0.0; 3]).chain(ends.iter().map(|end| [end.x, end.y, 0.0])).collect()
    }

    /// The points of the arm in its initial position.
    pub fn start(&self) -> Vec<Point> {
        self.points(&self.arm.position)
    }

    /// The tip at joint positions `q`.
    pub fn tip(&self, q: &[f64]) -> Point {
        self.points(q).last().copied().unwrap_or_default()
    }

    /// The desired tip at `time` seconds.
    pub fn desired(&self, time: f64) -> Point {
        desired(&self.trajectory, time)
    }

    /// The tracking error desired − actual at `time` seconds and joint positions `q`, a number for
    /// each axis of the task; entries past the last axis are zero.
    pub fn error(&self, time: f64, q: &[f64]) -> [f64; MAX_AXES] {
        for_joints!(self.arm.joints(), N => for_axes!(self.task, M => {
            let q = SVector::from_fn(|i, _| q.get(i).copied().unwrap_or(0.0));
            let at = Configuration::<f64, N>::new(&q, &SVector::zeros());
            let tip: SVector<f64, M> = self.arm.build::<N>().tip(&at);
            let error: SVector<f64, M> = Task::difference(&self.trajectory.at(time).point, &tip);
            padded(error.as_slice())
        }))
    }
}

fn desired(trajectory: &Trajectory<f64>, time: f64) -> Point {
    let position = trajectory.at::<2>(time).point;
    [position.x, position.y, 0.0]
}

fn path(path: Path<f64>) -> Vec<Point> {
    let period = match path {
        Path::Circle(circle) | Path::PerturbedCircle(circle, _) => {
            TAU / circle.angular_frequency.abs()
        }
        Path::PointToPoint(line) => line.duration,
        Path::Points(spline) => spline.points().last().map_or(0.0, |[end, ..]| *end),
    };
    // A circle that stands still has no period.
    let period = if period.is_finite() { period } else { 0.0 };
    let time = |i: usize| period * i as f64 / (PATH_POINTS - 1) as f64;
    (0..PATH_POINTS).map(|i| desired(&path.into(), time(i))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        Scene::new(&Scenario::load("sampled/mtj", &[]).unwrap())
    }

    #[test]
    fn the_points_of_the_arm_follow_its_angles() {
        let [base, elbow, tip] = scene().points(&[0.5, -1.25])[..] else { panic!() };
        assert_eq!(base, [0.0; 3]);
        for (point, expected) in [
            (elbow, [0.5f64.cos(), 0.5f64.sin(), 0.0]),
            (tip, [0.5f64.cos() + 0.75f64.cos(), 0.5f64.sin() - 0.75f64.sin(), 0.0]),
        ] {
            assert!(std::iter::zip(point, expected).all(|(a, b)| (a - b).abs() < 1e-15));
        }
        assert_eq!(scene().tip(&[0.5, -1.25]), tip);
        assert_eq!(scene().reach(), 2.0);
    }

    #[test]
    fn the_error_points_from_the_tip_to_the_desired_tip() {
        let scene = scene();
        let (desired, tip) = (scene.desired(0.3), scene.tip(&[1.0, 1.0]));
        let error = scene.error(0.3, &[1.0, 1.0]);
        assert_eq!(error[..2], [desired[0] - tip[0], desired[1] - tip[1]]);
        assert_eq!(error[2..], [0.0; 4]);
    }

    #[test]
    fn the_path_closes() {
        let scene = scene();
        let (first, last) = (scene.path()[0], scene.path()[PATH_POINTS - 1]);
        assert!(std::iter::zip(first, last).all(|(a, b)| (a - b).abs() < 1e-9));
        assert_eq!(first, scene.desired(0.0));
    }
}
