//! The monitor's command line.

use clap::Args;
use mtj_protocol::{bus::BusError, member::Role, options::RoleOptions};

#[cfg(feature = "foxglove")]
use crate::foxglove::FoxgloveOptions;
use crate::{
    fleet::{self, Pattern},
    lines::Lines,
    monitor::{self, Audience, Live},
    recording::options::RecordingOptions,
    terminal::TerminalOptions,
    web::{Place, WebOptions},
};

/// What a monitor that was started by another process says, on standard error, when it listens.
pub const LISTENING: &str = "mtj monitor: listening";

/// Run a monitor alone: a line a second, a dashboard in a browser or in the terminal, a recording
#[derive(Args, Clone, Debug)]
pub struct MonitorOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
    /// For whom.
    #[command(flatten)]
    pub audience: AudienceOptions,
}

/// For whom a monitor listens.
#[derive(Args, Clone, Debug, Default)]
pub struct AudienceOptions {
    /// The dashboard in a browser.
    #[command(flatten)]
    pub web: WebOptions,
    /// The dashboard in the terminal, instead of a line a second.
    #[command(flatten)]
    pub terminal: TerminalOptions,
    /// A file.
    #[command(flatten)]
    pub recording: RecordingOptions,
    /// Foxglove.
    #[cfg(feature = "foxglove")]
    #[command(flatten)]
    pub foxglove: FoxgloveOptions,
}

impl AudienceOptions {
    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        [
            self.web.arguments(),
            self.terminal.arguments(),
            self.recording.arguments(),
            #[cfg(feature = "foxglove")]
            self.foxglove.arguments(),
        ]
        .concat()
    }
}

impl MonitorOptions {
    /// Watches until asked to stop: one session, or all that a pattern means.
    pub fn run(&self) -> Result<(), BusError> {
        match &self.role.bus.session {
            Some(name) if Pattern::is_one(name) => self.watch_fleet(&name.parse()?),
            _ => self.watch_one(),
        }
    }

    fn watch_fleet(&self, pattern: &Pattern) -> Result<(), BusError> {
        if let Some(flag) = self.audience.arguments().first() {
            return Err(BusError::Settings(format!(
                "--session '{}' means many sessions, and {flag} is for one; name one, or leave out {flag} \
                 for a table of all",
                pattern.as_str()
            ).into()));
        }
        let mut role = self.role.clone();
        role.bus.session = None;
        let shutdown = role.shutdown();
        let Some(bus) = role.join(Role::Monitor, shutdown)? else { return Ok(()) };
        fleet::watch(&bus, pattern, std::io::stdout(), &|| shutdown.proceed())
    }

    fn watch_one(&self) -> Result<(), BusError> {
        let AudienceOptions { web, terminal, recording, .. } = &self.audience;
        // What cannot be is said before anything is begun.
        terminal.check()?;
        let settings = self.role.bus.settings();
        let settings = settings.map_err(|error| BusError::Settings(error.into()))?;
        let recording = recording.begin(&settings)?;
        let reception = web.listen()?;
        #[cfg(feature = "foxglove")]
        let foxglove = self.audience.foxglove.serve(&settings.session)?;
        let shutdown = self.role.shutdown();
        let Some(bus) = self.role.join(Role::Monitor, shutdown)? else { return Ok(()) };
        let mut source = Live::open(&bus)?;
        let mut audience: Vec<Box<dyn Audience>> = Vec::new();
        if let Some(reception) = reception {
            reception.join(&bus, &Place::from(&settings), &mut audience)?;
        }
        #[cfg(feature = "foxglove")]
        if let Some(foxglove) = foxglove {
            audience.push(Box::new(foxglove));
        }
        if let Some(recording) = recording {
            audience.push(Box::new(recording.start()?));
        }
        if self.role.until_stdin_closes {
            eprintln!("{LISTENING}");
        }
        match terminal.open(&self.role.bus)? {
            Some(dashboard) => audience.push(Box::new(dashboard)),
            None => audience.push(Box::new(Lines::new(std::io::stdout()))),
        }
        monitor::attend(&mut source, &mut audience, &|| shutdown.proceed())
    }
}
