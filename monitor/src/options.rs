//! The monitor's command line.

use clap::Args;
use mtj_protocol::{bus::BusError, options::RoleOptions};

use crate::watch::watch;

/// Run a monitor alone: it prints one line a second
#[derive(Args, Clone, Debug)]
pub struct MonitorOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
}

impl MonitorOptions {
    /// Watches until asked to stop.
    pub fn run(&self) -> Result<(), BusError> {
        let shutdown = self.role.shutdown();
        // Zenoh has a runtime of its own and must be opened outside ours.
        let Some(bus) = self.role.join(shutdown)? else { return Ok(()) };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .map_err(|error| BusError::Transport(format!("no runtime: {error}")))?;
        runtime.block_on(watch(&bus, &mut std::io::stdout(), &|| shutdown.proceed()))
    }
}
