//! The controller's command line.

use clap::Args;
use mtj_protocol::options::RoleOptions;

use crate::serve::{ServeError, serve};

/// Run the controller alone: it needs to know only where the plant is
#[derive(Args, Clone, Debug)]
pub struct ControllerOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
}

impl ControllerOptions {
    /// Serves until asked to stop.
    pub fn run(&self) -> Result<(), ServeError> {
        let shutdown = self.role.shutdown();
        match self.role.join(shutdown)? {
            Some(bus) => serve(&bus, self.role.wait(), &|| shutdown.proceed()),
            None => Ok(()),
        }
    }
}
