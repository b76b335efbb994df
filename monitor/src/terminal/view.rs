//! What the terminal dashboard knows: the overview, and the last minutes.

use std::{collections::VecDeque, sync::Arc};

use mtj_model::{
    MAX_JOINTS,
    law::Signal,
    scenario::Scenario,
    scene::{Point, Scene},
};
use mtj_protocol::{
    port::{Message, Offered},
    sample::{ErrorSample, StateSample, TorqueSample},
};

use super::track::Track;
use crate::overview::{Overview, gauge};

/// How long the trail behind the tip is, s.
const TRAIL: f64 = 2.0;
/// How many points it has.
const TRAIL_POINTS: usize = 400;

/// Everything that is drawn. A copy of it is a picture that stands still.
#[derive(Clone, Default)]
pub struct View {
    /// The newest of everything.
    pub overview: Overview,
    /// ‖e‖ of the measured tip at the samples' own times, m.
    pub error: Track,
    /// All numbers of the law's gauge, all in one.
    pub gauge: Track,
    /// Which signal that is: the last law's that had one.
    pub gauged: Option<&'static Signal>,
    /// The commanded torque of each joint, N m.
    pub torque: Vec<Track>,
    /// What there is to draw of the scenario.
    pub scene: Option<Arc<Scene>>,
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
    pub low: [f64; 2],
    /// The upper right corner.
    pub high: [f64; 2],
}

impl Stage {
    /// Around the origin and some points.
    pub fn around<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        let origin = Self { low: [0.0; 2], high: [0.0; 2] };
        points.into_iter().fold(origin, Self::with)
    }

    /// Large enough for a point, too.
    pub fn with(self, &[x, y, _]: &Point) -> Self {
        let Self { low, high } = self;
        Self { low: [low[0].min(x), low[1].min(y)], high: [high[0].max(x), high[1].max(y)] }
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

    /// The points of the arm by the newest measurement, base first, tip last.
    pub fn arm(&self) -> Option<Vec<Point>> {
        Some(self.scene.as_ref()?.points(&self.overview.state.as_ref()?.position))
    }

    /// Where the tip should have been at the newest measurement.
    pub fn desired(&self) -> Option<Point> {
        self.overview.state.as_ref()?;
        Some(self.scene.as_ref()?.desired(self.overview.time()))
    }

    /// ‖e‖ of the measured tip at the newest measurement, m.
    pub fn deviation(&self) -> Option<f64> {
        let state = self.overview.state.as_ref()?;
        let error = self.scene.as_ref()?.error(self.overview.time(), &state.position);
        Some(error.iter().map(|e| e * e).sum::<f64>().sqrt())
    }

    fn begin(&mut self, run: u64) {
        if self.run != Some(run) {
            let overview = std::mem::take(&mut self.overview);
            *self = Self { overview, run: Some(run), ..Self::default() };
        }
    }

    fn plan(&mut self, offered: &Offered) {
        let scene = Scene::new(&offered.scenario);
        self.stage = Some(Stage::around(scene.path().iter().chain(&scene.start())));
        self.scene = Some(Arc::new(scene));
    }

    fn hear_state(&mut self, state: &StateSample) {
        let time = state.header.time_ns as f64 * 1e-9;
        let (Some(arm), Some(deviation)) = (self.arm(), self.deviation()) else { return };
        self.stage = self.stage.map(|stage| arm.iter().fold(stage, Stage::with));
        self.error.push(time, deviation);
        let step = TRAIL / TRAIL_POINTS as f64;
        if self.trail.back().is_none_or(|(last, _)| time - last >= step) {
            self.trail.extend(arm.last().map(|tip| (time, *tip)));
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
        let Some(signal) = error.description().and_then(gauge) else { return };
        if self.gauged.replace(signal) != Some(signal) {
            self.gauge = Track::default();
        }
        for number in error.signal(signal.key).into_iter().flatten() {
            self.gauge.push(time, *number);
        }
    }
}
