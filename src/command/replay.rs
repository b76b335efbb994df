//! `mtj replay`: a recording played to a controller.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use clap::Args;
use mtj_model::scenario::Override;
use mtj_monitor::{
    error::MonitorError,
    monitor::{self, Sink},
    recording::{Player, Recording},
    web::{SessionInfo, WebOptions},
};
use mtj_protocol::shutdown::Shutdown;

use crate::failure::Failure;
use crate::replay;

/// Feed recorded states to a controller and compare its torques with the recorded ones, bit for
/// bit; or play the recording to a dashboard
#[derive(Args, Debug)]
pub struct Replay {
    /// A recording
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Answer under another law: set a key of the recorded scenario, like law.kind=tj
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Play the recording to a dashboard at this address, or at the next port that is free, instead
    #[arg(
        long,
        value_name = "HOST:PORT",
        num_args = 0..=1,
        default_missing_value = "127.0.0.1:8080",
        conflicts_with_all = ["set", "json"]
    )]
    serve: Option<String>,
    /// How many seconds of the recording to play in a second
    #[arg(long, value_name = "FACTOR", default_value = "1", value_parser = speed, requires = "serve")]
    speed: f64,
    /// Open the dashboard in a browser
    #[arg(long, requires = "serve")]
    open: bool,
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().ok().filter(|speed| (1e-6..=1e6).contains(speed));
    speed.ok_or_else(|| "expected a number more than 0, like 2 or 0.1".to_owned())
}

impl Replay {
    /// Prints what differs, or plays until asked to stop.
    pub fn run(self) -> Result<(), Failure> {
        let set = self.set.iter().map(|text| text.parse()).collect::<Result<Vec<Override>, _>>()?;
        let mut recording = Recording::open(&self.recording)?;
        if self.serve.is_some() {
            return self.play(recording);
        }
        let findings = replay::replay(&mut recording, &set).map_err(Failure::bad_input)?;
        let mut out = io::stdout().lock();
        if self.json {
            serde_json::to_writer(&mut out, &findings).map_err(io::Error::from)?;
            writeln!(out)?;
        } else {
            write!(out, "{findings}")?;
        }
        Ok(())
    }

    /// There is no plant whose knobs could be turned.
    fn play(self, recording: Recording) -> Result<(), Failure> {
        let shutdown = Shutdown::on_signals();
        let web = WebOptions {
            web: self.serve,
            open: self.open,
            read_only: true,
            ..WebOptions::default()
        };
        let session = SessionInfo {
            session: self.recording.display().to_string(),
            bus: "recording".to_owned(),
        };
        let mut sinks: Vec<Box<dyn Sink>> = Vec::new();
        if let Some(listener) = web.listen().map_err(MonitorError::from)? {
            let dashboard = listener.serve(&session, None).map_err(MonitorError::from)?;
            sinks.push(Box::new(dashboard));
        }
        let mut player = Player::new(recording, self.speed);
        Ok(monitor::run(&mut player, &mut sinks, &|| shutdown.proceed())?)
    }
}
