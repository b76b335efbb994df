//! `mtj monitor`: a monitor alone.

use std::io::{self, Write};

use clap::Args;
use mtj_monitor::{
    error::MonitorError,
    fleet::{self, Pattern},
    lines::Lines,
    monitor::{self, BusSource, Sink},
    recording::options::NewRecording,
    web::SessionInfo,
};
use mtj_options::{JoinOptions, RealtimeOptions, lossy::LossyWriter};
use mtj_protocol::{
    bus::BusError, member::Role, realtime::Realtime, shutdown::Shutdown, transport::AnyBus,
};

use crate::options::audience::AudienceOptions;

/// What a monitor that was started by another process says, on standard error, when it listens.
pub const LISTENING: &str = "mtj monitor: listening";

/// Run a monitor alone: a line a second, a dashboard in a browser or in the terminal, a recording
#[derive(Args, Clone, Debug)]
pub struct Monitor {
    #[command(flatten)]
    bus: JoinOptions,
    #[command(flatten)]
    audience: AudienceOptions,
    #[command(flatten)]
    realtime: RealtimeOptions,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    until_stdin_closes: bool,
}

impl Monitor {
    /// Monitors one session, or all that match a pattern, until asked to stop.
    pub fn run(&self) -> Result<(), MonitorError> {
        match &self.bus.session.session {
            Some(name) if Pattern::is_pattern(name) => self.run_fleet(&name.parse()?),
            _ => self.run_session(),
        }
    }

    fn shutdown(&self) -> Shutdown {
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes { shutdown.when_stdin_closes() } else { shutdown }
    }

    fn join(&self, bus: &JoinOptions, shutdown: Shutdown) -> Result<Option<AnyBus>, BusError> {
        let realtime = Realtime::from(&self.realtime);
        realtime.before_joining();
        let bus = bus.join(Role::Monitor, shutdown)?;
        realtime.before_the_loop()?;
        Ok(bus)
    }

    fn run_fleet(&self, pattern: &Pattern) -> Result<(), MonitorError> {
        if let Some(flag) = self.audience.arguments().first() {
            let pattern = pattern.as_str().to_owned();
            return Err(MonitorError::OneSessionOnly { pattern, flag: flag.clone() });
        }
        let mut bus = self.bus.clone();
        bus.session.session = None;
        let shutdown = self.shutdown();
        let Some(bus) = self.join(&bus, shutdown)? else { return Ok(()) };
        let out = LossyWriter::new(io::stdout()).map_err(|error| MonitorError::of(error, false))?;
        let result = fleet::run(&bus, pattern, out.clone(), &|| shutdown.proceed());
        out.finish();
        result
    }

    fn run_session(&self) -> Result<(), MonitorError> {
        let AudienceOptions { web, terminal, recording, .. } = &self.audience;
        // Bad input is reported before anything is started.
        terminal.check()?;
        let settings = self.bus.settings()?;
        let filter = self.audience.filter.filter();
        let recording = recording.create(&settings, filter.clone())?;
        let listener = web.listen()?;
        #[cfg(feature = "foxglove")]
        let foxglove = self.audience.foxglove.serve(&settings.session)?;
        let shutdown = self.shutdown();
        let Some(bus) = self.join(&self.bus, shutdown)? else { return Ok(()) };
        let mut source = BusSource::open(&bus)?;
        let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
        if let Some(listener) = listener {
            let saves = recording.as_ref().and_then(NewRecording::save_handle);
            let listener = listener.saving(saves);
            listener.serve_bus(&bus, &SessionInfo::from(&settings), &mut sinks)?;
        }
        #[cfg(feature = "foxglove")]
        if let Some(foxglove) = foxglove {
            sinks.push(Box::new(foxglove));
        }
        let recorder = recording.map(NewRecording::start).transpose()?;
        if self.until_stdin_closes {
            // The process that started this one waits for exactly this line.
            let _ = writeln!(io::stderr(), "{LISTENING}");
        }
        // Not held up by a terminal that takes nothing: a recording would lose samples.
        let out = LossyWriter::new(io::stdout()).map_err(|error| MonitorError::of(error, false))?;
        match terminal.open(&settings)? {
            Some(dashboard) => sinks.push(Box::new(dashboard)),
            None => sinks.push(Box::new(Lines::new(out.clone()))),
        }
        let mut sinks = filter.before(sinks);
        sinks.extend(recorder);
        let result = monitor::run(&mut source, &mut sinks, &|| shutdown.proceed());
        out.finish();
        result
    }
}
