//! `mtj tune`: gains, thresholds and memory for what is wanted.

use std::io::{self, Write};

use clap::Args;
use mtj_model::scenario::{BusKind, Override, Scenario, duration};
use mtj_protocol::shutdown::Shutdown;
use mtj_study::{
    experiment, shell,
    tune::{self, Latency, LatencySource, Wanted, print},
};

use super::run::launch_roles;
use crate::{failure::Failure, launcher::Launch, options::scenario::ScenarioOptions};

/// The torque limit where none is given, over the peak torque that the motion needs.
const SPARE_TORQUE: f64 = 1.5;

/// Propose gains, thresholds and memory, and verify them by simulation
#[derive(Args, Debug)]
pub struct Tune {
    #[command(flatten)]
    scenario: ScenarioOptions,
    /// Wanted time constant of the error, K_d/K_p
    #[arg(long, value_name = "DURATION", default_value = "2 s")]
    time_constant: String,
    /// Largest torque in N m, one number or one for each joint, like 18,10
    #[arg(long, value_name = "N[,N]")]
    torque_limit: Option<String>,
    /// Sample period; the scenario's unless given
    #[arg(long, value_name = "DURATION")]
    sample_period: Option<String>,
    /// Latency from sample to application, or 'measured' on the scenario's bus; the scenario's
    /// links' unless given
    #[arg(long, value_name = "DURATION|measured")]
    latency: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Tune {
    /// Prints a proposal that a simulation has verified.
    pub fn run(mut self) -> Result<(), Failure> {
        if let Some(period) = &self.sample_period {
            self.scenario.set.push(format!("timing.sample_period={period}"));
        }
        let scenario = self.scenario.load()?;
        let time_constant_s = seconds("--time-constant", &self.time_constant)?;
        if time_constant_s <= 0.0 {
            return Err(Failure::bad_input("--time-constant 0: expected more than nothing"));
        }
        // Before anything that takes long.
        if let Some(text) = &self.torque_limit {
            torque_limit(text, &scenario)?;
        }
        let of_links = tune::link_latency(&scenario)?;
        let shutdown = Shutdown::on_signals();
        let proceed = move || shutdown.proceed();
        let (latency, latency_source) = match self.latency.as_deref() {
            None => (of_links, LatencySource::Links),
            Some("measured") => {
                let seconds = of_links.mean_s + self.measured(&proceed)?;
                (Latency::constant(seconds), LatencySource::Measured)
            }
            Some(text) => (Latency::constant(seconds("--latency", text)?), LatencySource::Given),
        };
        let limit = self.torque_limit.as_deref();
        let (torque_limit_nm, source) = torque_limit_or_motion(limit, &scenario, &proceed)?;
        let wanted = Wanted { time_constant_s, torque_limit_nm, latency, latency_source };
        let proposal = tune::propose(&scenario, &wanted, &proceed)?;
        let command =
            shell::run_command(&self.scenario.scenario, &self.replay(&proposal, &wanted)?);
        let mut out = io::stdout().lock();
        if self.json {
            writeln!(out, "{}", print::object(&proposal, &wanted, &source, &command))?;
        } else {
            let table = print::table(&proposal, &wanted, &source);
            writeln!(out, "{table}\n{command}\n\n{}", print::snippet(&proposal).trim_end())?;
        }
        Ok(())
    }

    /// What to set for the run that was verified.
    fn replay(&self, proposal: &tune::Proposal, wanted: &Wanted) -> Result<Vec<Override>, Failure> {
        let scenario = self.scenario.load()?;
        let mut set: Vec<Override> =
            self.scenario.set.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        set.extend([
            Override::text("timing.clock", "lockstep"),
            Override::text("bus.kind", "local"),
        ]);
        if wanted.latency_source != LatencySource::Links {
            set.extend(tune::links(&scenario, wanted, 1.0));
        }
        set.extend(proposal.values.overrides(&scenario));
        Ok(set)
    }

    /// The 99th percentile of the round trip over two seconds on the scenario's bus, s.
    fn measured(&self, proceed: &(dyn Fn() -> bool + Sync)) -> Result<f64, Failure> {
        let mut options = self.scenario.clone();
        options.set.extend(["duration=2s".to_owned(), "timing.clock=realtime".to_owned()]);
        let scenario = options.load()?;
        let report = if scenario.bus.kind == BusKind::Local {
            experiment::run(&scenario, mtj_plant::plant::Watch::default(), proceed)?.report
        } else {
            launch_roles(
                Launch {
                    options,
                    keeps_open: false,
                    trace: None,
                    monitor: None,
                    realtime: Default::default(),
                },
                &scenario,
            )?
        };
        let trip = report.round_trip_us.ok_or_else(|| {
            Failure::other("the bus carried nothing from which a latency could be told")
        })?;
        Ok(trip.p99 * 1e-6)
    }
}

/// The torque limit, N m a joint, and where it is from: the option, the scenario, or the motion.
pub(super) fn torque_limit_or_motion(
    given: Option<&str>,
    scenario: &Scenario,
    proceed: &dyn Fn() -> bool,
) -> Result<(Vec<f64>, String), Failure> {
    match (given, &scenario.safety.torque_limit) {
        (Some(text), _) => Ok((torque_limit(text, scenario)?, "given".to_owned())),
        (None, Some(limit)) => Ok((limit.clone(), "the scenario's".to_owned())),
        (None, None) => {
            let peak = tune::motion(scenario, proceed)?.settled_torque_nm;
            let limit = peak.iter().map(|torque| SPARE_TORQUE * torque).collect();
            Ok((limit, format!("none given: {SPARE_TORQUE} x what the motion itself takes")))
        }
    }
}

pub(super) fn seconds(option: &str, text: &str) -> Result<f64, Failure> {
    let parsed = duration::parse(text).map(|duration| duration.as_secs_f64());
    parsed
        .ok_or_else(|| Failure::bad_input(format!("{option} {text}: expected {}", duration::FORM)))
}

fn torque_limit(text: &str, scenario: &Scenario) -> Result<Vec<f64>, Failure> {
    let joints = scenario.arm.links.len();
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|x: &f64| *x > 0.0 && x.is_finite()))
        .collect();
    match numbers {
        Some(numbers) if numbers.len() == joints => Ok(numbers),
        Some(numbers) if numbers.len() == 1 => Ok(vec![numbers[0]; joints]),
        _ => Err(Failure::bad_input(format!(
            "--torque-limit {text}: expected a torque in N m greater than 0, or {joints} with commas"
        ))),
    }
}
