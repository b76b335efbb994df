//! The monitor's command line.

use clap::Args;
use mtj_protocol::{
    bus::{AnyBus, BusError, Role},
    options::BusOptions,
    shutdown::Shutdown,
};

use crate::watch::watch;

/// Run a monitor alone: it prints one line a second
#[derive(Args, Clone, Debug)]
pub struct MonitorOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub bus: BusOptions,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    pub until_stdin_closes: bool,
}

impl MonitorOptions {
    /// Watches until asked to stop.
    pub fn run(&self) -> Result<(), BusError> {
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes {
            shutdown.when_stdin_closes();
        }
        let settings =
            self.bus.settings().map_err(|error| BusError::Settings(error.to_string()))?;
        let proceed = move || shutdown.proceed();
        // Zenoh has a runtime of its own and must be opened outside ours.
        let Some(bus) = AnyBus::open(&settings, Role::Other, &proceed)? else { return Ok(()) };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .build()
            .map_err(|error| BusError::Transport(format!("no runtime: {error}")))?;
        runtime.block_on(watch(&bus, &mut std::io::stdout(), &proceed))
    }
}
