//! The controller as a program of its own, for a machine that needs nothing else.

use std::{
    io::{self, Write},
    process::ExitCode,
};

use clap::Parser;
use mtj_controller::{program::ControllerOptions, serve::ServeError};
use mtj_protocol::bus::BusError;

#[derive(Parser)]
#[command(name = "mtj-controller", version, about)]
struct Program {
    #[command(flatten)]
    options: ControllerOptions,
}

fn main() -> ExitCode {
    let options = Program::parse().options;
    mtj_options::log::to_standard_error("mtj-controller");
    match options.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "mtj-controller: {error}");
            let is_bad_input = matches!(error, ServeError::Bus(BusError::Settings(_)));
            ExitCode::from(if is_bad_input { 2 } else { 1 })
        }
    }
}
