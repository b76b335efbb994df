//! The controller's command line.

use clap::Args;
use mtj_protocol::{
    member::{Member, Role},
    options::RoleOptions,
};

use crate::serve::{ServeError, serve};

/// Run the controller alone: it needs to know only where the plant is
#[derive(Args, Clone, Debug)]
pub struct ControllerOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
    /// Of several controllers the one with the highest takes over when the one in charge fails
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub precedence: u32,
}

impl ControllerOptions {
    /// Serves until asked to stop.
    pub fn run(&self) -> Result<(), ServeError> {
        let shutdown = self.role.shutdown();
        match self.role.join(Role::Controller, shutdown)? {
            Some(bus) => serve(
                &bus,
                &Member::new(Role::Controller, self.precedence),
                self.role.wait(),
                &|| shutdown.proceed(),
            ),
            None => Ok(()),
        }
    }
}
