//! The controller as a program of its own, for a machine that needs nothing else.

use std::{
    io::{self, Write},
    process::ExitCode,
};

use clap::Parser;
use mtj_controller::program::ControllerOptions;
use mtj_options::log;

#[derive(Parser)]
#[command(name = "mtj-controller", version, about)]
struct Program {
    #[command(flatten)]
    options: ControllerOptions,
}

fn main() -> ExitCode {
    let options = Program::parse().options;
    log::init(log::lines("mtj-controller"));
    let result = options.run();
    log::flush();
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "mtj-controller: {error}");
            ExitCode::from(if error.is_bad_input() { 2 } else { 1 })
        }
    }
}
