//! `mtj`: one program for all roles.

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use mtj_controller::options::ControllerOptions;
use mtj_monitor::options::MonitorOptions;
use mtj_plant::options::PlantOptions;
#[cfg(feature = "zenoh")]
use mtj_study::command::certs::Certs;
use mtj_study::command::{
    bench::Bench,
    bridge::BridgeCommand,
    completions::Completions,
    export::Export,
    knob::{Kick, Pause, Reset, Resume, Set},
    latency::{Echo, Latency},
    paper::Paper,
    replay::Replay,
    run::Run,
    scenario::ScenarioCommand,
    study::StudyCommand,
    tune::Tune,
    up::Up,
};
use mtj_study::failure::Failure;

/// Close a robot's control loop over a bus, and study what sample period and latency do to it
#[derive(Parser)]
#[command(name = "mtj", version)]
struct Program {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Up(Up),
    Run(Run),
    Plant(PlantOptions),
    Controller(ControllerOptions),
    Monitor(MonitorOptions),
    Bridge(BridgeCommand),
    Export(Export),
    Replay(Replay),
    Paper(Paper),
    Scenario(ScenarioCommand),
    Study(StudyCommand),
    Tune(Tune),
    Set(Set),
    Pause(Pause),
    Resume(Resume),
    Reset(Reset),
    Kick(Kick),
    Latency(Latency),
    #[command(hide = true)]
    Echo(Echo),
    #[cfg(feature = "zenoh")]
    Certs(Certs),
    Bench(Bench),
    Completions(Completions),
}

fn main() -> ExitCode {
    let mut arguments: Vec<_> = std::env::args_os().collect();
    if arguments.len() == 1 {
        arguments.push("up".into()); // What a newcomer wants to see.
    }
    match run(Program::parse_from(arguments).command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.sentence.is_empty() {
                eprintln!("mtj: {failure}");
            }
            ExitCode::from(failure.code)
        }
    }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Up(up) => up.run(),
        Command::Run(run) => run.run(),
        Command::Plant(plant) => Ok(plant.run()?),
        Command::Controller(controller) => Ok(controller.run()?),
        Command::Monitor(monitor) => Ok(monitor.run()?),
        Command::Bridge(bridge) => bridge.run(),
        Command::Export(export) => export.run(),
        Command::Replay(replay) => replay.run(),
        Command::Paper(paper) => paper.run(),
        Command::Scenario(scenario) => scenario.run(),
        Command::Study(study) => study.run(),
        Command::Tune(tune) => tune.run(),
        Command::Set(set) => set.run(),
        Command::Pause(pause) => pause.run(),
        Command::Resume(resume) => resume.run(),
        Command::Reset(reset) => reset.run(),
        Command::Kick(kick) => kick.run(),
        Command::Latency(latency) => latency.run(),
        Command::Echo(echo) => echo.run(),
        #[cfg(feature = "zenoh")]
        Command::Certs(certs) => certs.run(),
        Command::Bench(bench) => bench.run(),
        Command::Completions(completions) => completions.run(Program::command()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_well_formed() {
        Program::command().debug_assert();
    }
}
