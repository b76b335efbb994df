//! A controller on a bus: answers the states of the plant there.

use std::{
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::{Scenario, Wait};
use mtj_protocol::{
    bus::{Bus, BusError},
    member::Member,
    port::{self, ControllerPort, Received},
};

use crate::{Controller, LawError};

/// How often to look whether to go on.
const PATIENCE: Duration = Duration::from_millis(100);
/// How long to wait for a restarted plant's scenario before asking again.
const PAUSE: Duration = Duration::from_millis(5);

/// Why a controller stopped.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The law could not answer.
    #[error(transparent)]
    Law(#[from] LawError),
}

impl ServeError {
    /// Whether the user asked for something that cannot be: exit status 2.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, Self::Bus(error) if error.is_bad_input())
    }
}

/// Answers states as long as `proceed` is true: fetches the scenario, waits for a plant that is not
/// there yet, and fetches the scenario again when another plant replaces the old one.
///
/// Several controllers may serve one plant. The plant elects one of them to lead; the others stand
/// by and compute the law for every state, so that any of them can lead from the next one on.
///
/// Waits as the scenario says, unless `wait` says otherwise.
pub fn serve(
    bus: &impl Bus,
    member: &Member,
    wait: Option<Wait>,
    proceed: &dyn Fn() -> bool,
) -> Result<(), ServeError> {
    serve_with(bus, member, wait, proceed, &|scenario| Ok(Controller::new(scenario)))
}

/// Serves as [`serve`] does, with the controller that `make` makes of each scenario, like one with
/// a law of its own.
pub fn serve_with(
    bus: &impl Bus,
    member: &Member,
    wait: Option<Wait>,
    proceed: &dyn Fn() -> bool,
    make: &dyn Fn(&Scenario) -> Result<Controller, LawError>,
) -> Result<(), ServeError> {
    while let Some(offered) = port::fetch_scenario(bus, proceed)? {
        let wait = wait.unwrap_or(offered.scenario.bus.wait);
        let mut port = ControllerPort::open(bus, member, &offered, wait)?;
        serve_run(bus, &mut port, make(&offered.scenario)?, proceed)?;
        thread::sleep(PAUSE);
    }
    Ok(())
}

/// Answers the states of one run; returns when another run's appear, or when all must begin anew.
fn serve_run(
    bus: &impl Bus,
    port: &mut ControllerPort,
    mut controller: Controller,
    proceed: &dyn Fn() -> bool,
) -> Result<(), ServeError> {
    while proceed() {
        match port.receive(Instant::now() + PATIENCE)? {
            Some(Received::Misled) => return Ok(()),
            Some(Received::OtherRun) if port.newer_scenario(bus)?.is_some() => return Ok(()),
            None | Some(Received::OtherRun) => {}
            Some(Received::Repeated) => {
                let torque = controller.answer_again(port.state());
                if port.is_leader() {
                    port.send(torque)?;
                }
                port.flush()?;
            }
            Some(Received::New) => {
                let received = Instant::now();
                if let Some(changed) = port.newer_scenario(bus)? {
                    controller.reconfigure(&changed.scenario);
                }
                let torque = controller.respond(port.state())?;
                if port.is_leader() {
                    torque.residence_ns = received.elapsed().as_nanos() as u64;
                    port.send(torque)?;
                    port.publish(controller.error())?;
                }
                controller.preprocess(port.state());
                port.flush()?;
            }
        }
    }
    Ok(())
}
