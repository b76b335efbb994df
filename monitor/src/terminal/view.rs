//! What the terminal dashboard draws: the overview, and the last minutes.

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

use super::envelope::Envelope;
use crate::overview::{Overview, primary_signal};

/// The length of the trail behind the tip, s.
const TRAIL: f64 = 2.0;
/// The number of points of the trail.
const TRAIL_POINTS: usize = 400;

/// Everything that is drawn; a clone of it is a view that stands still.
#[derive(Clone, Debug, Default)]
pub(super) struct View {
    /// The newest message of each kind.
    pub overview: Overview,
    /// ‖e‖ of the measured tip at the samples' own times, m.
    pub error: Envelope,
    /// The law's primary signal, all axes in one envelope.
    pub signal: Envelope,
    /// The description of that signal, of the last law that had one.
    pub signal_description: Option<&'static Signal>,
    /// The commanded torque of each joint, N m.
    pub torque: Vec<Envelope>,
    /// The scene of the scenario.
    pub scene: Option<Arc<Scene>>,
    /// The last positions of the measured tip with their times, oldest first.
    pub trail: VecDeque<(f64, Point)>,
    /// The area that the drawing of the arm shows.
    pub bounds: Option<Bounds>,
    run: Option<u64>,
}

/// A rectangle in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    /// The lower left corner.
    pub low: [f64; 2],
    /// The upper right corner.
    pub high: [f64; 2],
}

impl Bounds {
    /// The bounds of the origin and some points.
    pub(super) fn around<'a>(points: impl IntoIterator<Item = &'a Point>) -> Self {
        let origin = Self { low: [0.0; 2], high: [0.0; 2] };
        points.into_iter().fold(origin, Self::with)
    }

    /// The bounds extended to a point.
    pub(super) fn with(self, &[x, y, _]: &Point) -> Self {
        let Self { low, high } = self;
        Self { low: [low[0].min(x), low[1].min(y)], high: [high[0].max(x), high[1].max(y)] }
    }
}

impl View {
    /// Takes one message.
    pub(super) fn handle(&mut self, message: &Message) {
        self.overview.handle(message);
        match message {
            Message::Scenario(offered) => {
                self.begin(offered.run);
                self.set_scenario(offered);
            }
            Message::State(state) => {
                self.begin(state.header.run);
                self.handle_state(state);
            }
            Message::Status(status) => self.begin(status.header.run),
            Message::Torque(torque) => self.handle_torque(torque),
            Message::Error(error) => self.handle_error(error),
            _ => {}
        }
    }

    /// The scenario of the run.
    pub(super) fn scenario(&self) -> Option<&Scenario> {
        self.overview.scenario.as_ref().map(|offered| &offered.scenario)
    }

    /// The measured points of the arm, base first, tip last.
    pub(super) fn arm(&self) -> Option<Vec<Point>> {
        Some(self.scene.as_ref()?.points(&self.overview.state.as_ref()?.position))
    }

    /// The desired tip at the newest measurement.
    pub(super) fn desired(&self) -> Option<Point> {
        self.overview.state.as_ref()?;
        Some(self.scene.as_ref()?.desired(self.overview.time()))
    }

    /// ‖e‖ of the measured tip at the newest measurement, m.
    pub(super) fn tip_error(&self) -> Option<f64> {
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

    fn set_scenario(&mut self, offered: &Offered) {
        let scene = Scene::new(&offered.scenario);
        self.bounds = Some(Bounds::around(scene.path().iter().chain(&scene.start())));
        self.scene = Some(Arc::new(scene));
    }

    fn handle_state(&mut self, state: &StateSample) {
        let time = state.header.time_ns as f64 * 1e-9;
        let (Some(arm), Some(tip_error)) = (self.arm(), self.tip_error()) else { return };
        self.bounds = self.bounds.map(|bounds| arm.iter().fold(bounds, Bounds::with));
        self.error.push(time, tip_error);
        let step = TRAIL / TRAIL_POINTS as f64;
        if self.trail.back().is_none_or(|(last, _)| time - last >= step) {
            self.trail.extend(arm.last().map(|tip| (time, *tip)));
        }
        while self.trail.front().is_some_and(|(first, _)| time - first > TRAIL) {
            self.trail.pop_front();
        }
    }

    fn handle_torque(&mut self, torque: &TorqueSample) {
        let time = torque.header.time_ns as f64 * 1e-9;
        let joints = MAX_JOINTS.min(torque.header.joints as usize);
        self.torque.resize_with(joints, Envelope::default);
        for (envelope, torque) in self.torque.iter_mut().zip(torque.torque) {
            envelope.push(time, torque);
        }
    }

    fn handle_error(&mut self, error: &ErrorSample) {
        let time = error.header.time_ns as f64 * 1e-9;
        let Some(signal) = error.description().and_then(primary_signal) else { return };
        if self.signal_description.replace(signal) != Some(signal) {
            self.signal = Envelope::default();
        }
        for number in error.signal(signal.key).into_iter().flatten() {
            self.signal.push(time, *number);
        }
    }
}
