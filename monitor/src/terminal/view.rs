//! What the terminal dashboard knows: the overview, and the last minutes.

use std::{collections::VecDeque, f64::consts::TAU, sync::Arc};

use mtj_model::{MAX_AXES, MAX_JOINTS, scenario::Scenario, trajectory::Trajectory};
use mtj_protocol::{
    port::{Message, Offered},
    sample::{ErrorSample, StateSample, TorqueSample},
};
use nalgebra::Vector2;

use super::track::Track;
use crate::overview::Overview;

/// How long the trail behind the tip is, s.
const TRAIL: f64 = 2.0;
/// How many points it has.
const TRAIL_POINTS: usize = 400;
/// How many points the desired path has.
const PATH_POINTS: usize = 400;

/// A point in the plane, m.
pub type Point = Vector2<f64>;

/// Everything that is drawn. A copy of it is a picture that stands still.
#[derive(Clone, Default)]
pub struct View {
    /// The newest of everything.
    pub overview: Overview,
    /// ‖e‖ of the measured tip at the samples' own times, m.
    pub error: Track,
    /// The regulating factor of each axis, all in one.
    pub factor: Track,
    /// The commanded torque of each joint, N m.
    pub torque: Vec<Track>,
    /// The desired path.
    pub path: Arc<Vec<Point>>,
    /// Where the measured tip was lately, with the time, oldest first.
    pub trail: VecDeque<(f64, Point)>,
    /// What fits on the drawing of the arm.
    pub stage: Option<Stage>,
    run: Option<u64>,
}

/// A rectangle in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// The lower left corner.
    pub low: Point,
    /// The upper right corner.
    pub high: Point,
}

impl Stage {
    /// Around some points.
    pub fn around(points: &[Point]) -> Self {
        let none = Self { low: Point::zeros(), high: Point::zeros() };
        points.iter().fold(none, |stage, point| stage.with(point))
    }

    /// Large enough for a point, too.
    pub fn with(self, point: &Point) -> Self {
        Self { low: self.low.inf(point), high: self.high.sup(point) }
    }
}

impl View {
    /// Takes in one message.
    pub fn hear(&mut self, message: &Message) {
        self.overview.hear(message);
        match message {
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.plan(offered);
            }
            Message::State(state) => {
                self.begin(state.header.run);
                self.hear_state(state);
            }
            Message::Status(status) => self.begin(status.header.run),
            Message::Torque(torque) => self.hear_torque(torque),
            Message::Error(error) => self.hear_error(error),
            _ => {}
        }
    }

    /// The scenario of the run.
    pub fn scenario(&self) -> Option<&Scenario> {
        self.overview.scenario.as_ref().map(|offered| &offered.scenario)
    }

    /// Where the links end by the newest measurement, base first.
    pub fn arm(&self) -> Option<Vec<Point>> {
        let state = self.overview.state.as_ref()?;
        Some(self.scenario()?.arm.ends(&state.position))
    }

    /// Where the tip should have been at the newest measurement.
    pub fn desired(&self) -> Option<Point> {
        self.overview.state.as_ref()?;
        Some(self.scenario()?.trajectory.at(self.overview.time()).position)
    }

    /// Desired less measured tip, at the newest measurement.
    pub fn deviation(&self) -> Option<Point> {
        Some(self.desired()? - self.arm()?.last()?)
    }

    fn begin(&mut self, run: u64) {
        if self.run != Some(run) {
            let overview = std::mem::take(&mut self.overview);
            *self = Self { overview, run: Some(run), ..Self::default() };
        }
    }

    fn plan(&mut self, offered: &Offered) {
        let scenario = &offered.scenario;
        self.path = Arc::new(path(&scenario.trajectory));
        let start = scenario.arm.ends(&scenario.arm.position);
        self.stage = Some(Stage::around(&[&self.path[..], &start].concat()));
    }

    fn hear_state(&mut self, state: &StateSample) {
        let time = state.header.time_ns as f64 * 1e-9;
        let Some(ends) = self.arm() else { return };
        for end in &ends {
            self.stage = self.stage.map(|stage| stage.with(end));
        }
        let (Some(tip), Some(desired)) = (ends.last(), self.desired()) else { return };
        self.error.push(time, (desired - tip).norm());
        let step = TRAIL / TRAIL_POINTS as f64;
        if self.trail.back().is_none_or(|(last, _)| time - last >= step) {
            self.trail.push_back((time, *tip));
        }
        while self.trail.front().is_some_and(|(first, _)| time - first > TRAIL) {
            self.trail.pop_front();
        }
    }

    fn hear_torque(&mut self, torque: &TorqueSample) {
        let time = torque.header.time_ns as f64 * 1e-9;
        let joints = MAX_JOINTS.min(torque.header.joints as usize);
        self.torque.resize_with(joints, Track::default);
        for (track, torque) in self.torque.iter_mut().zip(torque.torque) {
            track.push(time, torque);
        }
    }

    fn hear_error(&mut self, error: &ErrorSample) {
        let time = error.header.time_ns as f64 * 1e-9;
        let axes = MAX_AXES.min(error.header.axes as usize);
        for factor in &error.factor[..axes] {
            self.factor.push(time, *factor);
        }
    }
}

/// One round of a desired motion, or all of it if it comes to rest.
fn path(trajectory: &Trajectory<f64>) -> Vec<Point> {
    let duration = match trajectory {
        Trajectory::Circle(circle) | Trajectory::PerturbedCircle(circle, _) => {
            TAU / circle.angular_frequency.abs()
        }
        Trajectory::PointToPoint(line) => line.duration,
    };
    // A circle that does not turn is a point.
    let duration = if duration.is_finite() { duration } else { 0.0 };
    (0..PATH_POINTS)
        .map(|i| trajectory.at(duration * i as f64 / (PATH_POINTS - 1) as f64).position)
        .collect()
}
