//! A controller on a bus: answers the states of the plant there.

use std::{
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::{Scenario, Wait};
use mtj_protocol::{
    bus::{Bus, BusError},
    member::Member,
    port::{self, ControllerPort, Received, Tolerance},
    stall,
};

use crate::{Controller, LawError};

/// How often to look whether to go on.
const PATIENCE: Duration = Duration::from_millis(100);
/// How long to wait for a restarted plant's scenario before asking again.
const PAUSE: Duration = Duration::from_millis(5);

/// Why a controller stopped. Once it has answered, nothing that fails around it stops it.
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
    let mut tolerance = Tolerance::default();
    let mut has_served = false;
    while proceed() {
        let joined = port::fetch_scenario(bus, proceed).and_then(|offered| {
            let Some(offered) = offered else { return Ok(None) };
            let wait = wait.unwrap_or(offered.scenario.bus.wait);
            Ok(Some((ControllerPort::open(bus, member, &offered, wait)?, offered)))
        });
        let joined =
            if has_served { tolerance.tolerate("join another run", joined) } else { joined? };
        if let Some((mut port, offered)) = joined {
            serve_run(bus, &mut port, make(&offered.scenario)?, &mut tolerance, proceed)?;
            has_served = true;
        }
        thread::sleep(PAUSE);
    }
    Ok(())
}

/// Answers the states of one run; returns when another run's appear, or when all must begin anew.
fn serve_run(
    bus: &impl Bus,
    port: &mut ControllerPort,
    mut controller: Controller,
    tolerance: &mut Tolerance,
    proceed: &dyn Fn() -> bool,
) -> Result<(), ServeError> {
    let mut is_told = false;
    while proceed() {
        let until = Instant::now() + PATIENCE;
        let received = port.receive(until);
        if received.is_err() {
            // A reader that fails at once would leave no processor to the rest.
            thread::sleep(PAUSE);
        }
        match tolerance.tolerate("receive states", received) {
            Some(Received::Misled) => return Ok(()),
            Some(Received::OtherRun) => {
                let newer = port.newer_scenario(bus);
                if tolerance.tolerate("fetch the scenario", newer).is_some() {
                    return Ok(());
                }
            }
            None => {}
            Some(Received::Repeated) => {
                let torque = controller.answer_again(port.state());
                if port.is_leader() {
                    tolerance.tolerate("send torques", port.send(torque));
                }
                tolerance.tolerate("publish what was sent", port.flush());
            }
            Some(Received::New) => {
                let received = Instant::now();
                if let Some(stall) = stall::stall(until, received) {
                    stall::tell("the controller", stall, "what it missed, it cannot answer");
                }
                let newer = port.newer_scenario(bus);
                if let Some(changed) = tolerance.tolerate("fetch the scenario", newer) {
                    controller.reconfigure(&changed.scenario);
                }
                let torque = controller.respond(port.state())?;
                if port.is_leader() {
                    torque.residence_ns = received.elapsed().as_nanos() as u64;
                    tolerance.tolerate("send torques", port.send(torque));
                    tolerance.tolerate("publish errors", port.publish(controller.error()));
                }
                if controller.is_damped() && !std::mem::replace(&mut is_told, true) {
                    tracing::warn!(
                        "the arm is near a singular posture, where the law damps the inverse that it \
                         needs: expect an error there (said once; the law's signals show it)"
                    );
                }
                controller.preprocess(port.state());
                tolerance.tolerate("publish what was sent", port.flush());
            }
        }
    }
    Ok(())
}
