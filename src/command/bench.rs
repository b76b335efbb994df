//! `mtj bench`: how fast this program is on this machine.

use std::{io, num::NonZero, thread};

use clap::{Args, Subcommand};
use mtj_protocol::shutdown::Shutdown;

use crate::{benchmark::sweep, failure::Failure};

/// Measure how fast this program is on this machine
#[derive(Args, Debug)]
pub struct Bench {
    #[command(subcommand)]
    part: Part,
}

#[derive(Debug, Subcommand)]
enum Part {
    /// Runs a second a core in a sweep, and how far they are from the scalar reference
    Sweep(Sweep),
}

#[derive(Args, Debug)]
struct Sweep {
    /// Runs in lanes on each thread
    #[arg(long, value_name = "N", default_value = "10000")]
    runs: NonZero<usize>,
    /// The most threads; as many as there are cores unless given
    #[arg(long, value_name = "N")]
    threads: Option<NonZero<usize>>,
    /// Runs to hold against the scalar path at a tenth of its step
    #[arg(long, value_name = "N", default_value = "32")]
    checks: usize,
}

impl Bench {
    /// Measures and prints.
    pub fn run(self) -> Result<(), Failure> {
        match self.part {
            Part::Sweep(Sweep { runs, threads, checks }) => {
                let cores = || thread::available_parallelism().map_or(1, NonZero::get);
                let threads = threads.map_or_else(cores, NonZero::get);
                let settings = sweep::Settings { runs: runs.get(), threads, checks };
                let shutdown = Shutdown::on_signals();
                sweep::sweep(&settings, &mut io::stdout().lock(), &move || shutdown.proceed())
            }
        }
    }
}
