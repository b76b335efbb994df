//! `mtj set`, `pause`, `resume`, `reset` and `kick`: the knobs of a running loop.

use std::{
    io::{self, Write},
    time::{Duration, Instant},
};

use clap::Args;
use mtj_model::scenario::{Override, ScenarioError, duration};
use mtj_options::JoinOptions;
use mtj_protocol::{
    member::Role,
    port::{Offered, RequestPort, Unanswered, fetch_scenario},
    request::Request,
    shutdown::Shutdown,
    transport::AnyBus,
};

use crate::failure::Failure;

/// How long to look for a plant, and how long it may take to answer.
const PATIENCE: Duration = Duration::from_secs(3);

/// Change keys of a running loop between two samples, like law.memory.policy=delivered
#[derive(Args, Debug)]
pub struct Set {
    /// What to set, as behind --set; several take effect together
    #[arg(required = true, value_name = "KEY=VALUE")]
    sets: Vec<String>,
    #[command(flatten)]
    bus: JoinOptions,
}

/// Pause a running loop: time and arm stand still
#[derive(Args, Debug)]
pub struct Pause {
    #[command(flatten)]
    bus: JoinOptions,
}

/// Resume a paused loop
#[derive(Args, Debug)]
pub struct Resume {
    #[command(flatten)]
    bus: JoinOptions,
}

/// Begin a new run from the initial state, with the scenario as it is by now
#[derive(Args, Debug)]
pub struct Reset {
    #[command(flatten)]
    bus: JoinOptions,
}

/// Disturb the arm of a running loop with a torque that no controller knows of
#[derive(Args, Debug)]
pub struct Kick {
    /// Torque on each joint, N m
    #[arg(long, value_delimiter = ',', allow_negative_numbers = true, default_value = "20")]
    torque: Vec<f64>,
    /// For how long
    #[arg(long, default_value = "100ms")]
    duration: String,
    #[command(flatten)]
    bus: JoinOptions,
}

impl Set {
    /// Sets the keys.
    pub fn run(self) -> Result<(), Failure> {
        let sets: Vec<Override> =
            self.sets.iter().map(|text| text.parse()).collect::<Result<_, ScenarioError>>()?;
        turn(&self.bus, &Request::Set(self.sets), |offered| {
            // Said here in full; the plant's answer has room for a few words.
            offered.scenario.changed(&sets).map(drop)
        })
    }
}

impl Pause {
    /// Pauses the loop.
    pub fn run(self) -> Result<(), Failure> {
        turn(&self.bus, &Request::Pause, |_| Ok(()))
    }
}

impl Resume {
    /// Resumes the loop.
    pub fn run(self) -> Result<(), Failure> {
        turn(&self.bus, &Request::Resume, |_| Ok(()))
    }
}

impl Reset {
    /// Begins anew.
    pub fn run(self) -> Result<(), Failure> {
        turn(&self.bus, &Request::Reset, |_| Ok(()))
    }
}

impl Kick {
    /// Kicks the arm.
    pub fn run(self) -> Result<(), Failure> {
        let length = duration::parse(&self.duration).ok_or_else(|| {
            Failure::bad_input(format!("--duration {}: expected {}", self.duration, duration::FORM))
        })?;
        let milliseconds = length.as_secs_f64() * 1e3;
        turn(&self.bus, &Request::Kick { torque: self.torque, milliseconds }, |_| Ok(()))
    }
}

/// Asks the plant on a bus to turn a knob, and prints what became of that.
fn turn(
    options: &JoinOptions,
    request: &Request,
    check: impl Fn(&Offered) -> Result<(), ScenarioError>,
) -> Result<(), Failure> {
    request.check().map_err(Failure::bad_input)?;
    let settings = options.settings()?;
    let shutdown = Shutdown::on_signals();
    let end = Instant::now() + PATIENCE;
    let proceed = || shutdown.proceed() && Instant::now() < end;
    let nobody = || {
        let bus = settings.kind.name();
        format!(
            "there is no plant in session '{}' on {bus}; start one, or say where it is with --session, \
             --bus or --connect",
            settings.session
        )
    };
    let bus = AnyBus::open(&settings, Role::Operator, &proceed)?
        .ok_or_else(|| Failure::other(nobody()))?;
    let mut port = RequestPort::open(&bus)?;
    let offered = fetch_scenario(&bus, &proceed)?.ok_or_else(|| Failure::other(nobody()))?;
    check(&offered)?;
    let change = port
        .ask(offered.run, request, Instant::now() + PATIENCE)?
        .ok_or_else(|| Failure::other(Unanswered))?;
    change.outcome().map_err(Failure::bad_input)?;
    let (time, sample) = (change.header.time_ns as f64 * 1e-9, change.header.sequence);
    let words = change.words();
    writeln!(io::stdout(), "{words}: in effect from t = {time:.3} s, sample {sample}")?;
    Ok(())
}
