//! `mtj monitor`: a monitor alone.

use std::io::{self, Write};

use clap::Args;
use mtj_monitor::{
    fleet::{self, Pattern},
    lines::Lines,
    monitor::{self, Audience, Live},
    web::Place,
};
use mtj_options::{JoinOptions, RealtimeOptions};
use mtj_protocol::{member::Role, realtime::Realtime, shutdown::Shutdown, transport::AnyBus};

use crate::{failure::Failure, options::audience::AudienceOptions};

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
    /// Watches until asked to stop: one session, or all that a pattern means.
    pub fn run(&self) -> Result<(), Failure> {
        match &self.bus.session.session {
            Some(name) if Pattern::is_one(name) => self.watch_fleet(&name.parse()?),
            _ => self.watch_one(),
        }
    }

    fn shutdown(&self) -> Shutdown {
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes { shutdown.when_stdin_closes() } else { shutdown }
    }

    fn join(&self, bus: &JoinOptions, shutdown: Shutdown) -> Result<Option<AnyBus>, Failure> {
        let realtime = Realtime::from(&self.realtime);
        realtime.before_joining();
        let bus = bus.join(Role::Monitor, shutdown)?;
        realtime.before_the_loop()?;
        Ok(bus)
    }

    fn watch_fleet(&self, pattern: &Pattern) -> Result<(), Failure> {
        if let Some(flag) = self.audience.arguments().first() {
            return Err(Failure::bad_input(format!(
                "--session '{}' means many sessions, and {flag} is for one; name one, or leave out {flag} \
                 for a table of all",
                pattern.as_str()
            )));
        }
        let mut bus = self.bus.clone();
        bus.session.session = None;
        let shutdown = self.shutdown();
        let Some(bus) = self.join(&bus, shutdown)? else { return Ok(()) };
        Ok(fleet::watch(&bus, pattern, io::stdout(), &|| shutdown.proceed())?)
    }

    fn watch_one(&self) -> Result<(), Failure> {
        let AudienceOptions { web, terminal, recording, .. } = &self.audience;
        // What cannot be is said before anything is begun.
        terminal.check()?;
        let settings = self.bus.settings()?;
        let recording = recording.begin(&settings)?;
        let reception = web.listen()?;
        #[cfg(feature = "foxglove")]
        let foxglove = self.audience.foxglove.serve(&settings.session)?;
        let shutdown = self.shutdown();
        let Some(bus) = self.join(&self.bus, shutdown)? else { return Ok(()) };
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
        if self.until_stdin_closes {
            writeln!(io::stderr(), "{LISTENING}")?;
        }
        match terminal.open(&settings)? {
            Some(dashboard) => audience.push(Box::new(dashboard)),
            None => audience.push(Box::new(Lines::new(io::stdout()))),
        }
        Ok(monitor::attend(&mut source, &mut audience, &|| shutdown.proceed())?)
    }
}
