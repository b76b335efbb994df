//! The monitor's command line.

use clap::Args;
use mtj_protocol::{member::Role, options::RoleOptions};

#[cfg(feature = "foxglove")]
use crate::foxglove::FoxgloveOptions;
use crate::{
    error::MonitorError,
    fleet::{self, Pattern},
    lines::Lines,
    monitor::{self, BusSource, Sink},
    recording::options::RecordingOptions,
    terminal::TerminalOptions,
    web::{SessionInfo, WebOptions},
};

/// The line on standard error by which a monitor tells the process that started it that it listens.
pub const LISTENING: &str = "mtj monitor: listening";

/// Run a monitor alone: a line a second, a dashboard in a browser or in the terminal, a recording
#[derive(Args, Clone, Debug)]
pub struct MonitorOptions {
    /// Where the plant is.
    #[command(flatten)]
    pub role: RoleOptions,
    /// Which displays and recordings.
    #[command(flatten)]
    pub audience: AudienceOptions,
}

/// Which displays and recordings a monitor feeds.
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
    /// Monitors one session, or all that match a pattern, until asked to stop.
    pub fn run(&self) -> Result<(), MonitorError> {
        match &self.role.bus.session {
            Some(name) if Pattern::is_pattern(name) => self.run_fleet(&name.parse()?),
            _ => self.run_session(),
        }
    }

    fn run_fleet(&self, pattern: &Pattern) -> Result<(), MonitorError> {
        if let Some(flag) = self.audience.arguments().first() {
            let pattern = pattern.as_str().to_owned();
            return Err(MonitorError::OneSessionOnly { pattern, flag: flag.clone() });
        }
        let mut role = self.role.clone();
        role.bus.session = None;
        let shutdown = role.shutdown();
        let Some(bus) = role.join(Role::Monitor, shutdown)? else { return Ok(()) };
        fleet::run(&bus, pattern, std::io::stdout(), &|| shutdown.proceed())
    }

    fn run_session(&self) -> Result<(), MonitorError> {
        let AudienceOptions { web, terminal, recording, .. } = &self.audience;
        // Bad input is reported before anything is started.
        terminal.check()?;
        let settings = self.role.bus.settings()?;
        let recording = recording.create(&settings)?;
        let listener = web.listen()?;
        #[cfg(feature = "foxglove")]
        let foxglove = self.audience.foxglove.serve(&settings.session)?;
        let shutdown = self.role.shutdown();
        let Some(bus) = self.role.join(Role::Monitor, shutdown)? else { return Ok(()) };
        let mut source = BusSource::open(&bus)?;
        let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
        if let Some(listener) = listener {
            listener.serve_bus(&bus, &SessionInfo::from(&settings), &mut sinks)?;
        }
        #[cfg(feature = "foxglove")]
        if let Some(foxglove) = foxglove {
            sinks.push(Box::new(foxglove));
        }
        if let Some(recording) = recording {
            sinks.push(Box::new(recording.start()?));
        }
        if self.role.until_stdin_closes {
            // The process that started this one waits for exactly this line.
            eprintln!("{LISTENING}");
        }
        match terminal.open(&settings)? {
            Some(dashboard) => sinks.push(Box::new(dashboard)),
            None => sinks.push(Box::new(Lines::new(std::io::stdout()))),
        }
        monitor::run(&mut source, &mut sinks, &|| shutdown.proceed())
    }
}
