//! The monitor's command line.

use clap::Args;
use mtj_protocol::{bus::BusError, options::RoleOptions};

use crate::{
    lines::Lines,
    monitor::{self, Audience, Live},
    web::{Place, WebOptions},
};

/// What a monitor that was started by another process says, on standard error, when it listens.
pub const LISTENING: &str = "mtj monitor: listening";

/// Run a monitor alone: it prints one line a second, and serves a dashboard with --web
#[derive(Args, Clone, Debug)]
pub struct MonitorOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
    /// The dashboard in a browser.
    #[command(flatten)]
    pub web: WebOptions,
}

impl MonitorOptions {
    /// Watches until asked to stop.
    pub fn run(&self) -> Result<(), BusError> {
        let shutdown = self.role.shutdown();
        let reception = self.web.listen()?;
        let Some(bus) = self.role.join(shutdown)? else { return Ok(()) };
        let mut audience: Vec<Box<dyn Audience>> = vec![Box::new(Lines::new(std::io::stdout()))];
        if let Some(reception) = reception {
            let settings = self.role.bus.settings();
            let settings = settings.map_err(|error| BusError::Settings(error.to_string()))?;
            reception.join(&bus, &Place::from(&settings), &mut audience)?;
        }
        let mut source = Live::open(&bus)?;
        if self.role.until_stdin_closes {
            eprintln!("{LISTENING}");
        }
        monitor::attend(&mut source, &mut audience, &|| shutdown.proceed())
    }
}
