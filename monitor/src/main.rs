//! The monitor as a program of its own.

use std::process::ExitCode;

use clap::Parser;
use mtj_monitor::options::MonitorOptions;

#[derive(Parser)]
#[command(name = "mtj-monitor", version, about)]
struct Program {
    #[command(flatten)]
    options: MonitorOptions,
}

fn main() -> ExitCode {
    match Program::parse().options.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("mtj-monitor: {error}");
            ExitCode::from(if error.is_bad_input() { 2 } else { 1 })
        }
    }
}
