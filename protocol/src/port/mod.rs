//! The ports: what each role may send and receive on a bus.

mod bridge;
mod controller;
mod lease;
mod monitor;
mod offer;
mod other_plants;
mod plant;
mod presence;
mod request;
mod sent;

use std::{
    mem::{self, Discriminant},
    time::Instant,
};

use mtj_model::scenario::Scenario;

pub use self::{
    bridge::{Bridge, Traffic},
    controller::{ControllerPort, Received},
    monitor::{Message, MonitorPort},
    offer::{Offered, fetch_scenario},
    plant::PlantPort,
    request::{REPEAT, RequestPort, Unanswered},
};
use crate::{
    admission::Rejection,
    bus::BusError,
    sample::{ChangeSample, RequestSample, Sample, StateSample, StatusSample, TorqueSample},
    warn_once::WarnOnce,
};

/// The exchange that closes the loop, as the plant sees it.
pub trait Exchange {
    /// Sends a state to the controller; fills in the leader.
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError>;
    /// Advances to the controller's next answer; waits for it until `until`.
    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError>;
    /// The answer that was received last.
    fn torque(&self) -> &TorqueSample;
    /// Publishes the status of the run.
    fn report(&mut self, status: &StatusSample) -> Result<(), BusError>;
    /// How many torque samples were not acceptable.
    fn rejected(&self) -> u64;
    /// How often the leader changed.
    fn takeovers(&self) -> u64 {
        0
    }
    /// The next request, if there is one. Without a bus there is none.
    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        Ok(None)
    }
    /// Publishes the answer to a request.
    fn announce(&mut self, _change: &ChangeSample) -> Result<(), BusError> {
        Ok(())
    }
    /// Offers a changed scenario.
    fn renew(&mut self, _scenario: &Scenario, _revision: u32) -> Result<(), BusError> {
        Ok(())
    }
}

/// A controller's answer to a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A torque that may act on the arm.
    Torque,
    /// A torque that must not act, because it is not finite.
    NotFinite,
}

/// What fails around a role that has joined: said once for each task, counted always. The role
/// goes on.
#[derive(Debug, Default)]
pub struct Tolerance(WarnOnce<&'static str>);

impl Tolerance {
    /// The result of a task or, if it failed, the default.
    pub fn tolerate<T: Default>(&mut self, task: &'static str, result: Result<T, BusError>) -> T {
        result.unwrap_or_else(|error| {
            if self.0.first(task) {
                tracing::warn!("cannot {task} ({error}); the loop goes on (said once)");
            }
            T::default()
        })
    }
}

/// The warnings about rejected samples: one for each reason.
#[derive(Debug, Default)]
struct Rejections(WarnOnce<Discriminant<Rejection>>);

impl Rejections {
    fn warn<S: Sample>(&mut self, rejection: Rejection) {
        if self.0.first(mem::discriminant(&rejection)) {
            tracing::warn!(
                "ignoring a {} sample: {rejection} (said once, counted always)",
                S::TOPIC
            );
        }
    }
}
