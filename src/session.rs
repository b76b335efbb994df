//! Many runs over one real bus: the plant in this process, one controller in another.

use std::{cell::RefCell, process::Child};

use mtj_model::scenario::{Override, Scenario};
use mtj_plant::{
    plant::{self, Outcome, Watch},
    run_id,
};
use mtj_protocol::{
    bus::BusError, member::Role, port::PlantPort, realtime::Realtime, transport::AnyBus,
};
use mtj_study::StudyError;

use crate::{
    launcher::Launch,
    options::{realtime::LoopRealtime, scenario::ScenarioOptions},
};

/// A controller process on a bus of its own, which follows the plant from run to run.
pub struct Session {
    bus: AnyBus,
    launch: Launch,
    scenario: Scenario,
    set: Vec<Override>,
    controller: Option<Child>,
}

impl Session {
    /// Opens a bus as the options say; `None` if asked to stop.
    pub fn open(
        options: ScenarioOptions,
        realtime: LoopRealtime,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Self>, StudyError> {
        let launch = Launch { keeps_open: false, trace: None, monitor: None, options, realtime };
        let named = launch.options.load()?;
        let launch = launch.separate(&named)?;
        let scenario = launch.options.load()?;
        launch.realtime.check(scenario.bus.wait)?;
        let set = launch.options.bus.overrides();
        Realtime::from(&launch.realtime.plant()).before_joining();
        let bus = AnyBus::open(&scenario.bus, Role::Plant, proceed)?;
        Ok(bus.map(|bus| Self { bus, launch, scenario, set, controller: None }))
    }

    /// What it was opened with.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Runs a scenario on this bus; `None` if asked to stop. A controller that gave up at an
    /// earlier scenario is replaced.
    pub fn run(
        &mut self,
        scenario: &Scenario,
        proceed: &dyn Fn() -> bool,
    ) -> Result<Option<Outcome>, StudyError> {
        let scenario = Scenario::parse(&scenario.name, scenario.text(), &self.set)?;
        let controller = match self.controller.take() {
            Some(controller) => controller,
            None => self.launch.controller_command(&self.scenario)?.spawn()?,
        };
        // Not before: a process is born where the one is that starts it.
        Realtime::from(&self.launch.realtime.plant()).before_the_loop()?;
        let controller = RefCell::new(controller);
        let is_alive = || matches!(controller.borrow_mut().try_wait(), Ok(None));
        let run = run_id::fresh();
        let mut port = PlantPort::open(&self.bus, &scenario, run)?;
        let watch = Watch { round_trips: true, ..Watch::default() };
        let go_on = || proceed() && is_alive();
        let outcome = plant::run(&scenario, run, &mut port, watch, &go_on)?;
        if !is_alive() && proceed() {
            return Err(BusError::Controller("the controller gave up".into()).into());
        }
        self.controller = Some(controller.into_inner());
        Ok((!outcome.interrupted).then_some(outcome))
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        if let Some(mut controller) = self.controller.take() {
            drop(controller.stdin.take()); // It ends by itself when this closes.
            let _ = controller.wait();
        }
    }
}
