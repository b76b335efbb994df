//! One run within this process.

use std::thread;

use mtj_controller::{Controller, serve};
use mtj_model::scenario::{ClockKind, Scenario};
use mtj_plant::{
    direct::Direct,
    engine::{Engine, engine},
    error::PlantError,
    plant::{self, Outcome, Watch},
};
use mtj_protocol::{
    bus::BusError,
    local::LocalBus,
    member::{Member, Role},
    port::PlantPort,
};

/// Runs a scenario with plant and controller in this process: by plain calls in lockstep, over the
/// local bus with a thread for the controller in real time.
pub fn run(
    scenario: &Scenario,
    watch: Watch,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Outcome, PlantError> {
    match scenario.timing.clock {
        ClockKind::Lockstep => {
            run_watched(scenario, Controller::new(scenario), engine(scenario), watch, proceed)
        }
        ClockKind::Realtime => run_in_threads(scenario, watch, proceed),
    }
}

/// Runs a scenario in lockstep, the controller a function call away.
pub fn run_direct(
    scenario: &Scenario,
    trace: bool,
    proceed: &dyn Fn() -> bool,
) -> Result<Outcome, PlantError> {
    run_with(scenario, Controller::new(scenario), engine(scenario), trace, proceed)
}

/// Runs a scenario in lockstep with a controller or an engine of one's own.
///
/// # Errors
///
/// A link that cannot be emulated, or a law that cannot answer.
pub fn run_with(
    scenario: &Scenario,
    controller: Controller,
    engine: Box<dyn Engine>,
    trace: bool,
    proceed: &dyn Fn() -> bool,
) -> Result<Outcome, PlantError> {
    run_watched(scenario, controller, engine, Watch { trace, ..Watch::default() }, proceed)
}

fn run_watched(
    scenario: &Scenario,
    mut controller: Controller,
    engine: Box<dyn Engine>,
    watch: Watch,
    proceed: &dyn Fn() -> bool,
) -> Result<Outcome, PlantError> {
    let mut exchange = Direct::new(0, |state: &_| controller.respond(state).copied());
    plant::run_engine(scenario, 0, engine, &mut exchange, watch, proceed)
}

/// Runs a scenario over the local bus, with plant and controller in threads of their own.
fn run_in_threads(
    scenario: &Scenario,
    watch: Watch,
    proceed: &(dyn Fn() -> bool + Sync),
) -> Result<Outcome, PlantError> {
    let bus = LocalBus::default();
    let run = 1;
    thread::scope(|scope| {
        let (done, wait_for_done) = std::sync::mpsc::channel::<()>();
        let plant_bus = bus.clone();
        let plant = scope.spawn(move || {
            let _done = done; // Dropped with the thread, whatever happens in it.
            let mut port = PlantPort::open(&plant_bus, scenario, run)?;
            let watch = Watch { round_trips: true, ..watch };
            plant::run(scenario, run, &mut port, watch, proceed)
        });
        let running = || {
            proceed()
                && matches!(wait_for_done.try_recv(), Err(std::sync::mpsc::TryRecvError::Empty))
        };
        let served = serve::serve(&bus, &Member::new(Role::Controller, 0), None, &running);
        let outcome = plant.join().unwrap_or_else(|_| {
            Err(BusError::Transport("the plant's thread panicked".into()).into())
        });
        served.map_err(|error| BusError::Controller(error.into()).into()).and(outcome)
    })
}
