//! `mtj run`: one run without a screen.

use clap::Args;
use mtj_model::scenario::{BusKind, BusSettings, Scenario};
use mtj_plant::{plant::Watch, report::Report, trace::TraceStream};
use mtj_protocol::{shutdown::Shutdown, transport::AnyBus};
use mtj_study::experiment;

use crate::{
    failure::Failure,
    launcher::Launch,
    options::{output::OutputOptions, realtime::LoopRealtime, scenario::ScenarioOptions},
};

/// One run without a screen; prints its measures
#[derive(Args, Debug)]
pub struct Run {
    #[command(flatten)]
    scenario: ScenarioOptions,
    #[command(flatten)]
    output: OutputOptions,
    #[command(flatten)]
    realtime: LoopRealtime,
}

impl Run {
    /// Runs in this process on the local bus, in processes of their own on any other.
    pub fn run(self) -> Result<(), Failure> {
        let scenario = self.scenario.load()?;
        // Also tells at once whether the path can be written.
        let file = self.output.open_trace()?;
        if scenario.bus.kind == BusKind::Local {
            self.scenario.load_with_advice()?; // On another bus the plant says it.
            if let Some(option) = self.realtime.plant().arguments().first() {
                return Err(Failure::bad_input(format!(
                    "{option} is for processes, and bus.kind = \"local\" has none of their own; add --bus iceoryx2"
                )));
            }
            let shutdown = Shutdown::on_signals();
            let proceed = move || shutdown.proceed();
            let trace = file.map(|file| TraceStream::begin(&scenario, file)).transpose()?;
            let (stream, writer) = trace.unzip();
            let watch = Watch { stream, ..Watch::default() };
            let outcome = experiment::run(&scenario, watch, &proceed)?;
            self.output.finish(&outcome.report, writer)?;
        } else {
            let trace = self.output.trace.clone();
            let launch = Launch {
                options: self.scenario,
                keeps_open: false,
                trace,
                monitor: None,
                realtime: self.realtime,
            };
            self.output.print(&launch_roles(launch, &scenario)?)?;
        }
        Ok(())
    }
}

/// Runs the roles as processes on a runtime of their own.
pub fn launch_roles(launch: Launch, scenario: &Scenario) -> Result<Report, Failure> {
    // Said once here, not by each role.
    AnyBus::check(&BusSettings { identity: None, ..scenario.bus.clone() })?;
    launch.realtime.check(scenario.bus.wait)?;
    Shutdown::on_signals(); // The roles stop by themselves; this process waits for them.
    let launch = launch.separate(scenario)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(launch.run(scenario))?)
}
