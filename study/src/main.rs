//! `mtj`: one program for all roles.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use mtj_controller::options::ControllerOptions;
use mtj_monitor::options::MonitorOptions;
use mtj_plant::options::PlantOptions;
use mtj_study::command::{Failure, run::Run, scenario::ScenarioCommand, up::Up};

/// Close a robot's control loop over a bus, and study what sample period and latency do to it
#[derive(Parser)]
#[command(name = "mtj", version)]
struct Program {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    Up(Up),
    Run(Run),
    Plant(PlantOptions),
    Controller(ControllerOptions),
    Monitor(MonitorOptions),
    Scenario(ScenarioCommand),
}

fn main() -> ExitCode {
    let program = Program::parse();
    let command = program.command.unwrap_or_else(|| Program::parse_from(["mtj", "up"]).command());
    match run(command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.sentence.is_empty() {
                eprintln!("mtj: {failure}");
            }
            ExitCode::from(failure.code)
        }
    }
}

impl Program {
    /// The command of a line that names one.
    fn command(self) -> Command {
        self.command.unwrap_or_else(|| std::process::exit(2))
    }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Up(up) => up.run(),
        Command::Run(run) => run.run(),
        Command::Plant(plant) => Ok(plant.run()?),
        Command::Controller(controller) => Ok(controller.run()?),
        Command::Monitor(monitor) => Ok(monitor.run()?),
        Command::Scenario(scenario) => scenario.run(),
    }
}
