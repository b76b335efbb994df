//! The controller's command line.

use clap::Args;
use mtj_protocol::{
    bus::{AnyBus, BusError, Role},
    options::BusOptions,
    shutdown::Shutdown,
};

use crate::serve::{ServeError, serve};

/// Run the controller alone: it needs to know only where the plant is
#[derive(Args, Clone, Debug)]
pub struct ControllerOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub bus: BusOptions,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    pub until_stdin_closes: bool,
}

impl ControllerOptions {
    /// Serves until asked to stop.
    pub fn run(&self) -> Result<(), ServeError> {
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes {
            shutdown.when_stdin_closes();
        }
        let settings =
            self.bus.settings().map_err(|error| BusError::Settings(error.to_string()))?;
        let proceed = move || shutdown.proceed();
        let wait = self.bus.wait.is_some().then_some(settings.wait);
        match AnyBus::open(&settings, Role::Other, &proceed)? {
            Some(bus) => serve(&bus, wait, &proceed),
            None => Ok(()),
        }
    }
}
