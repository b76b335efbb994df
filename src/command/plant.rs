//! `mtj plant`: a plant alone.

use std::fs::File;

use clap::Args;
use mtj_options::RealtimeOptions;
use mtj_plant::{
    plant::{self, Watch},
    run_id,
    trace::{TraceStream, TraceWriter},
};
use mtj_protocol::{
    member::Role, port::PlantPort, realtime::Realtime, shutdown::Shutdown, transport::AnyBus,
};

use crate::{
    failure::Failure,
    options::{output::OutputOptions, scenario::ScenarioOptions},
};

/// Run the plant alone: it owns the arm, the clock and the scenario
#[derive(Args, Clone, Debug)]
pub struct Plant {
    #[command(flatten)]
    scenario: ScenarioOptions,
    #[command(flatten)]
    output: OutputOptions,
    #[command(flatten)]
    realtime: RealtimeOptions,
    /// After a divergence wait for a reset ('mtj reset') rather than end
    #[arg(long)]
    keep_open: bool,
    /// Stop when standard input ends
    #[arg(long, hide = true)]
    until_stdin_closes: bool,
}

impl Plant {
    /// Runs the scenario once with whatever controller joins, and prints the measures.
    pub fn run(&self) -> Result<(), Failure> {
        let mut scenario = self.scenario.load_with_advice()?;
        let file = self.output.open_trace()?;
        let shutdown = Shutdown::on_signals();
        if self.until_stdin_closes {
            shutdown.when_stdin_closes();
        }
        let proceed = move || shutdown.proceed();
        let realtime = Realtime::from(&self.realtime);
        realtime.before_joining();
        let Some(bus) = AnyBus::open(&scenario.bus, Role::Plant, &proceed)? else { return Ok(()) };
        let mut run = run_id::fresh();
        let mut port = PlantPort::open(&bus, &scenario, run)?;
        realtime.before_the_loop()?;
        let mut watch = Watch { round_trips: true, keeps_open: self.keep_open, ..Watch::default() };
        loop {
            // After a reset the trace begins anew.
            let file = file.as_ref().map(File::try_clone).transpose()?;
            let trace = file.map(|file| TraceStream::begin(&scenario, file)).transpose()?;
            let (stream, writer) = trace.unzip();
            watch.stream = stream;
            let outcome = plant::run(&scenario, run, &mut port, watch.clone(), &proceed)?;
            watch.stream = None;
            let Some(reset) = outcome.reset else {
                return self.output.finish(&outcome.report, writer);
            };
            drop(writer.map(TraceWriter::finish));
            (scenario, run) = (reset, run_id::fresh());
            port.restart(&scenario, run)?;
        }
    }
}
