//! The true tip and its tracking error.

use mtj_model::{
    arm::{Kinematics, planar::Configuration},
    for_axes, for_joints,
    matrix::padded,
    scenario::Scenario,
    task::Task,
    trajectory::Trajectory,
};
use mtj_protocol::sample::Axes;
use nalgebra::SVector;

use crate::engine::State;

/// The truth about the tip at an instant; entries past the task's axes are zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tracked {
    /// The tip, m.
    pub(crate) tip: Axes,
    /// Where it should be, m.
    pub(crate) desired: Axes,
    /// e = desired ⊖ actual, m.
    pub(crate) error: Axes,
}

/// Computes the true tip of a scenario's arm from its state.
pub(crate) struct Tracking(Box<Track>);

type Track = dyn Fn(&State, &Trajectory<f64>) -> Tracked;

impl Tracking {
    /// With the kinematics of a scenario's arm.
    pub(crate) fn new(scenario: &Scenario) -> Self {
        Self(for_joints!(scenario.arm.joints(), N => for_axes!(scenario.task, M => {
            let arm = scenario.arm.build::<N>();
            Box::new(move |state, trajectory| {
                let joints = |list: &[f64]| SVector::<f64, N>::from_column_slice(&list[..N]);
                let at = Configuration::new(&joints(&state.position), &joints(&state.velocity));
                let tip: SVector<f64, M> = arm.tip(&at);
                let desired = trajectory.at::<M>(state.time_ns as f64 * 1e-9).point;
                let error: SVector<f64, M> = Task::difference(&desired, &tip);
                let axes = |list: &SVector<f64, M>| padded(list.as_slice());
                Tracked { tip: axes(&tip), desired: axes(&desired), error: axes(&error) }
            })
        })))
    }

    /// The truth about the tip in a state, with this desired motion.
    pub(crate) fn at(&self, state: &State, trajectory: &Trajectory<f64>) -> Tracked {
        (self.0)(state, trajectory)
    }
}
