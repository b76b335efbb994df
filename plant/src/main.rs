//! The plant as a program of its own.

use std::process::ExitCode;

use clap::Parser;
use mtj_plant::options::PlantOptions;

#[derive(Parser)]
#[command(name = "mtj-plant", version, about)]
struct Program {
    #[command(flatten)]
    options: PlantOptions,
}

fn main() -> ExitCode {
    match Program::parse().options.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("mtj-plant: {error}");
            ExitCode::from(if error.is_bad_input() { 2 } else { 1 })
        }
    }
}
