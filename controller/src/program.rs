//! The controller's command line.

use std::cell::Cell;

use clap::Args;
use mtj_model::scenario::{BusSettings, Scenario, Wait};
use mtj_options::{BusOptions, JoinOptions, RealtimeOptions};
use mtj_protocol::{
    bus::BusError,
    member::{Member, Role},
    realtime::Realtime,
    shutdown::Shutdown,
};

use crate::{
    Controller,
    serve::{ServeError, serve_with},
};

/// Run the controller alone: it needs to know only where the plant is
#[derive(Args, Clone, Debug)]
pub struct ControllerOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub bus: JoinOptions,
    /// How the loop waits, if not as the scenario says: spin (needs a core of its own), hybrid or
    /// block
    #[arg(long, value_name = "MODE")]
    pub wait: Option<String>,
    /// How it runs.
    #[command(flatten)]
    pub realtime: RealtimeOptions,
    /// Of several controllers the one with the highest leads, and the next one when it fails
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub precedence: u32,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    pub until_stdin_closes: bool,
}

impl ControllerOptions {
    /// Serves until asked to stop.
    ///
    /// # Errors
    ///
    /// An option that is not acceptable, a bus that fails, or a law that cannot answer.
    pub fn run(&self) -> Result<(), ServeError> {
        let wait = self.wait()?;
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes {
            shutdown.when_stdin_closes();
        }
        let realtime = Realtime::from(&self.realtime);
        realtime.before_joining();
        let bus = self.bus.join(Role::Controller, shutdown)?;
        realtime.before_the_loop()?;
        let Some(bus) = bus else { return Ok(()) };
        let member = Member::new(Role::Controller, self.precedence);
        // A launcher that started this controller says itself what runs.
        let is_told = Cell::new(self.until_stdin_closes);
        let make = |scenario: &Scenario| {
            if !is_told.replace(true) {
                let law = scenario.law.law.description().name;
                let BusSettings { session, kind, .. } = &scenario.bus;
                let (name, bus) = (&scenario.name, kind.name());
                tracing::info!("answers {name} under {law} in session '{session}' over {bus}");
            }
            Ok(Controller::new(scenario))
        };
        serve_with(&bus, &member, wait, &|| shutdown.proceed(), &make)
    }

    fn wait(&self) -> Result<Option<Wait>, BusError> {
        if self.wait.is_none() {
            return Ok(None);
        }
        let options = BusOptions { wait: self.wait.clone(), ..BusOptions::from(self.bus.clone()) };
        Ok(Some(options.settings()?.wait))
    }
}
