//! The plant's command line.

use std::{
    fmt,
    fs::File,
    io::{self, BufWriter, Write},
    path::PathBuf,
    time::SystemTime,
};

use clap::Args;
use mtj_model::scenario::{Override, Scenario, ScenarioError};
use mtj_protocol::{
    bus::BusError, member::Role, options::BusOptions, port::PlantPort, realtime::RealtimeOptions,
    shutdown::Shutdown, transport::AnyBus,
};

use crate::{
    plant::{self, Outcome, Watch},
    report::Report,
    trace,
};

/// Which experiment.
#[derive(Args, Clone, Debug)]
pub struct ScenarioOptions {
    /// Built-in scenario ('mtj scenario list' prints them) or a TOML file
    #[arg(long, value_name = "NAME|FILE", default_value = "sampled/mtj")]
    pub scenario: String,
    /// Set any key of the scenario, like law.memory.policy=delivered; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Where the other roles are.
    #[command(flatten)]
    pub bus: BusOptions,
}

impl ScenarioOptions {
    /// Loads the scenario with everything set that was asked for.
    pub fn load(&self) -> Result<Scenario, ScenarioError> {
        let mut overrides: Vec<Override> =
            self.set.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        overrides.extend(self.bus.overrides());
        Scenario::load(&self.scenario, &overrides)
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        let mut arguments = vec!["--scenario".to_owned(), self.scenario.clone()];
        for set in &self.set {
            arguments.extend(["--set".to_owned(), set.clone()]);
        }
        arguments.extend(self.bus.arguments());
        arguments
    }
}

/// What to do with a run's results.
#[derive(Args, Clone, Debug, Default)]
pub struct OutputOptions {
    /// Print the measures as one JSON object
    #[arg(long)]
    pub json: bool,
    /// Write every sampling instant to a CSV file
    #[arg(long, value_name = "FILE.csv")]
    pub trace: Option<PathBuf>,
}

impl OutputOptions {
    /// Creates the trace's file, so that a path that cannot be written is known before the run.
    pub fn create_trace(&self) -> Result<Option<File>, BusError> {
        let Some(path) = &self.trace else { return Ok(None) };
        File::create(path).map(Some).map_err(|error| {
            BusError::Settings(
                format!("--trace {}: {error}; choose a file that can be written", path.display())
                    .into(),
            )
        })
    }

    /// Writes the trace, and the measures to standard output.
    pub fn finish(
        &self,
        scenario: &Scenario,
        outcome: &Outcome,
        trace: Option<File>,
    ) -> io::Result<()> {
        self.print(&outcome.report)?;
        let (Some(file), Some(path)) = (trace, &self.trace) else { return Ok(()) };
        let mut out = BufWriter::new(file);
        trace::write_csv(&mut out, scenario, &outcome.trace).and_then(|()| out.flush()).map_err(
            |error| {
                io::Error::new(
                    error.kind(),
                    format!("--trace {}: {error}; the run's measures are complete", path.display()),
                )
            },
        )
    }

    /// Writes the measures to standard output.
    pub fn print(&self, report: &Report) -> io::Result<()> {
        let mut out = io::stdout().lock();
        if self.json {
            serde_json::to_writer(&mut out, report)?;
            writeln!(out)
        } else {
            write!(out, "{report}")
        }
    }
}

/// Run the plant alone: it owns the arm, the clock and the scenario
#[derive(Args, Clone, Debug)]
pub struct PlantOptions {
    /// Which experiment.
    #[command(flatten)]
    pub scenario: ScenarioOptions,
    /// What to do with the results.
    #[command(flatten)]
    pub output: OutputOptions,
    /// How it runs.
    #[command(flatten)]
    pub realtime: RealtimeOptions,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    pub until_stdin_closes: bool,
}

/// Why a plant stopped before it was done.
#[derive(Debug)]
pub enum PlantError {
    /// The scenario is not acceptable.
    Scenario(ScenarioError),
    /// The bus failed.
    Bus(BusError),
    /// The results could not be written.
    Output(io::Error),
}

impl PlantError {
    /// Whether the user asked for something that cannot be.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Scenario(_) => true,
            Self::Bus(error) => error.is_bad_input(),
            _ => false,
        }
    }
}

impl fmt::Display for PlantError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scenario(error) => error.fmt(f),
            Self::Bus(error) => error.fmt(f),
            Self::Output(error) => write!(f, "the results could not be written: {error}"),
        }
    }
}

impl std::error::Error for PlantError {}

impl From<ScenarioError> for PlantError {
    fn from(error: ScenarioError) -> Self {
        Self::Scenario(error)
    }
}

impl From<BusError> for PlantError {
    fn from(error: BusError) -> Self {
        Self::Bus(error)
    }
}

impl From<io::Error> for PlantError {
    fn from(error: io::Error) -> Self {
        Self::Output(error)
    }
}

impl PlantOptions {
    /// Runs the scenario once with whatever controller joins, and prints the measures.
    pub fn run(&self) -> Result<(), PlantError> {
        let mut scenario = self.scenario.load()?;
        let trace = self.output.create_trace()?;
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes {
            shutdown.when_stdin_closes();
        }
        let proceed = move || shutdown.proceed();
        self.realtime.before_joining();
        let Some(bus) = AnyBus::open(&scenario.bus, Role::Plant, &proceed)? else { return Ok(()) };
        let mut run = fresh_run_id();
        let mut port = PlantPort::open(&bus, &scenario, run)?;
        self.realtime.before_the_loop()?;
        let watch = Watch { trace: trace.is_some(), round_trips: true };
        loop {
            let outcome = plant::run(&scenario, run, &mut port, watch, &proceed)?;
            let Some(reset) = outcome.reset else {
                return Ok(self.output.finish(&scenario, &outcome, trace)?);
            };
            (scenario, run) = (reset, fresh_run_id());
            port.restart(&scenario, run)?;
        }
    }
}

/// A number that no other incarnation of a plant has: the time in nanoseconds and the process id.
pub fn fresh_run_id() -> u64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    (now.as_nanos() as u64) ^ (u64::from(std::process::id()) << 40)
}
