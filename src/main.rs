//! `mtj`: one program for all roles. Each command is a file of `command/`.

#![allow(unreachable_pub, reason = "a program has no public surface")]

mod benchmark;
#[cfg(feature = "zenoh")]
mod certificates;
mod command;
mod failure;
mod launcher;
mod options;
mod paper;
mod replay;
mod session;

use std::{
    io::{self, Write},
    process::ExitCode,
};

use clap::{CommandFactory, Parser, Subcommand};
use mtj_controller::program::ControllerOptions;
use mtj_monitor::terminal::log_layer;
use mtj_options::log;

use self::{
    benchmark::round_trip::ECHO,
    command::{
        advise::Advise,
        bench::Bench,
        bridge::BridgeCommand,
        completions::Completions,
        export::Export,
        latency::{Echo, Latency},
        monitor::Monitor,
        paper::Paper,
        plant::Plant,
        replay::Replay,
        request::{Kick, Pause, Reset, Resume, Set},
        run::Run,
        scenario::ScenarioCommand,
        study::StudyCommand,
        tune::Tune,
        up::Up,
    },
    failure::Failure,
};

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
    Plant(Plant),
    Controller(ControllerOptions),
    Monitor(Monitor),
    Bridge(BridgeCommand),
    Export(Export),
    Replay(Replay),
    Paper(Paper),
    Scenario(ScenarioCommand),
    Study(StudyCommand),
    Tune(Tune),
    Advise(Advise),
    Set(Set),
    Pause(Pause),
    Resume(Resume),
    Reset(Reset),
    Kick(Kick),
    Latency(Latency),
    #[cfg(feature = "zenoh")]
    Certs(command::certs::Certs),
    Bench(Bench),
    Completions(Completions),
}

impl Command {
    /// What the lines that it logs begin with.
    fn name(&self) -> &'static str {
        match self {
            Self::Plant(_) => "mtj plant",
            Self::Controller(_) => "mtj controller",
            Self::Monitor(_) => "mtj monitor",
            Self::Bridge(_) => "mtj bridge",
            _ => "mtj",
        }
    }
}

fn main() -> ExitCode {
    let mut arguments: Vec<_> = std::env::args_os().collect();
    if arguments.len() == 1 {
        arguments.push("up".into()); // What a newcomer wants to see.
    }
    // Not among the commands, so that it is neither listed nor suggested.
    let result = if arguments.get(1).is_some_and(|command| command == ECHO) {
        log::init(log::lines("mtj"));
        Echo::parse_from(&arguments[1..]).run()
    } else {
        let command = Program::parse_from(arguments).command;
        log::init(log_layer(log::lines(command.name())));
        run(command)
    };
    log::flush();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            if !failure.sentence.is_empty() {
                let _ = writeln!(io::stderr(), "mtj: {failure}");
            }
            ExitCode::from(failure.code)
        }
    }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Up(up) => up.run(),
        Command::Run(run) => run.run(),
        Command::Plant(plant) => plant.run(),
        Command::Controller(controller) => Ok(controller.run()?),
        Command::Monitor(monitor) => Ok(monitor.run()?),
        Command::Bridge(bridge) => bridge.run(),
        Command::Export(export) => export.run(),
        Command::Replay(replay) => replay.run(),
        Command::Paper(paper) => paper.run(),
        Command::Scenario(scenario) => scenario.run(),
        Command::Study(study) => study.run(),
        Command::Tune(tune) => tune.run(),
        Command::Advise(advise) => advise.run(),
        Command::Set(set) => set.run(),
        Command::Pause(pause) => pause.run(),
        Command::Resume(resume) => resume.run(),
        Command::Reset(reset) => reset.run(),
        Command::Kick(kick) => kick.run(),
        Command::Latency(latency) => latency.run(),
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
        Echo::command().debug_assert();
    }

    #[test]
    fn an_unknown_command_does_not_suggest_one_that_is_not_listed() {
        let error = Program::try_parse_from(["mtj", "eco"]).err().map(|error| error.to_string());
        assert!(!error.unwrap_or_default().contains("echo"));
        let error = Program::try_parse_from(["mtj", "stdy"]).err().map(|error| error.to_string());
        assert!(error.unwrap_or_default().contains("'study'"));
    }
}
