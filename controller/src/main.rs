//! The controller as a program of its own, for a machine that needs nothing else.

use std::process::ExitCode;

use clap::Parser;
use mtj_controller::{options::ControllerOptions, serve::ServeError};

#[derive(Parser)]
#[command(name = "mtj-controller", version, about)]
struct Program {
    #[command(flatten)]
    options: ControllerOptions,
}

fn main() -> ExitCode {
    match Program::parse().options.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("mtj-controller: {error}");
            let is_bad_input = matches!(&error, ServeError::Bus(error) if error.is_bad_input());
            ExitCode::from(if is_bad_input { 2 } else { 1 })
        }
    }
}
