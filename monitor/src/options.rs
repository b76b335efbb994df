//! The monitor's command line.

use clap::Args;
use mtj_protocol::{bus::BusError, options::RoleOptions};

use crate::{
    lines::Lines,
    monitor::{self, Audience, Live},
    terminal::TerminalOptions,
};

/// Run a monitor alone: it prints one line a second
#[derive(Args, Clone, Debug)]
pub struct MonitorOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
    /// Whether to draw on the terminal.
    #[command(flatten)]
    pub terminal: TerminalOptions,
}

impl MonitorOptions {
    /// Watches until asked to stop.
    pub fn run(&self) -> Result<(), BusError> {
        self.terminal.check()?;
        let shutdown = self.role.shutdown();
        let Some(bus) = self.role.join(shutdown)? else { return Ok(()) };
        let mut source = Live::open(&bus)?;
        let mut audience: Vec<Box<dyn Audience>> = Vec::new();
        match self.terminal.open(&self.role.bus)? {
            Some(dashboard) => audience.push(Box::new(dashboard)),
            None => audience.push(Box::new(Lines::new(std::io::stdout()))),
        }
        monitor::attend(&mut source, &mut audience, &|| shutdown.proceed())
    }
}
