//! Where the tip is in truth, and where it should be.

use mtj_model::{
    PLANE, for_links,
    scenario::{ArmSettings, Scenario},
};
use nalgebra::SVector;

use crate::engine::State;

/// A point of the task.
pub type Point = SVector<f64, PLANE>;

/// The tip of an arm, from its state.
pub struct Tracking(Box<dyn Fn(&State) -> Point>);

impl Tracking {
    /// With the kinematics of a scenario's arm.
    pub fn new(arm: &ArmSettings) -> Self {
        Self(for_links!(arm.links.len(), N => {
            let arm = arm.build::<N>();
            Box::new(move |state| {
                let joints = |list: &[f64]| SVector::<f64, N>::from_column_slice(&list[..N]);
                arm.pose(&joints(&state.position), &joints(&state.velocity)).tip()
            })
        }))
    }

    /// The tip, and where the scenario wants it at that time, m.
    pub fn at(&self, scenario: &Scenario, state: &State) -> (Point, Point) {
        let desired = scenario.trajectory.at(state.time_ns as f64 * 1e-9).position;
        ((self.0)(state), desired)
    }
}
