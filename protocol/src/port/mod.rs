//! What each role may say and hear on a bus.

mod bridge;
mod controller;
mod lease;
mod monitor;
mod offer;
mod plant;
mod presence;
mod request;

use std::{
    mem::{self, Discriminant},
    time::Instant,
};

use mtj_model::scenario::Scenario;

pub use self::{
    bridge::{Bridge, Traffic},
    controller::{ControllerPort, Heard},
    monitor::{Message, MonitorPort},
    offer::{Offered, fetch_scenario},
    plant::PlantPort,
    request::{REPEAT, RequestPort, UNANSWERED},
};
use crate::{
    bus::BusError,
    gate::Fault,
    sample::{ChangeSample, RequestSample, Sample, StateSample, StatusSample, TorqueSample},
};

/// The two-way exchange that closes the loop, as the plant sees it.
pub trait Exchange {
    /// Hands a state to the controller, with who is in charge filled in.
    fn send(&mut self, state: &mut StateSample) -> Result<(), BusError>;
    /// Goes on to the controller's next answer, waiting for it until `until`.
    fn receive(&mut self, until: Instant) -> Result<Option<Answer>, BusError>;
    /// The answer that was gone on to last.
    fn torque(&self) -> &TorqueSample;
    /// Tells monitors how the run goes.
    fn report(&mut self, status: &StatusSample) -> Result<(), BusError>;
    /// Torque samples that were not acceptable, so far.
    fn rejected(&self) -> u64;
    /// How often another controller took charge.
    fn takeovers(&self) -> u64 {
        0
    }
    /// The next request, if there is one. Without a bus there is none.
    fn request(&mut self) -> Result<Option<RequestSample>, BusError> {
        Ok(None)
    }
    /// Tells everybody what became of a request.
    fn announce(&mut self, _change: &ChangeSample) -> Result<(), BusError> {
        Ok(())
    }
    /// Offers a scenario that was changed.
    fn renew(&mut self, _scenario: &Scenario, _revision: u32) -> Result<(), BusError> {
        Ok(())
    }
}

/// What a controller's answer to a state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// A torque that may act on the arm.
    Torque,
    /// A torque that must not, because it is not finite.
    NotFinite,
}

/// Says what is wrong with the samples of others, once for each kind of fault.
#[derive(Default)]
struct Complaints(Vec<Discriminant<Fault>>);

impl Complaints {
    fn once<S: Sample>(&mut self, fault: Fault) {
        let kind = mem::discriminant(&fault);
        if !self.0.contains(&kind) {
            self.0.push(kind);
            eprintln!(
                "mtj: ignoring a {} sample: {} (said once, counted always)",
                S::TOPIC,
                fault.sentence()
            );
        }
    }
}
