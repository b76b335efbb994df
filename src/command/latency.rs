//! `mtj latency`: what a round trip costs here.

use std::{
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::PathBuf,
    time::Duration,
};

use clap::{Args, Parser, ValueEnum};
use mtj_model::scenario::{BusKind, DEFAULT_SPIN, Wait};
use mtj_options::RealtimeOptions;
use mtj_protocol::{realtime::Realtime, shutdown::Shutdown};

use crate::{
    benchmark::round_trip::{self, Effort, Measurement, Proceed, Way, print},
    failure::Failure,
    options::realtime::LoopRealtime,
};

/// This machine's loop round trip per transport and way of waiting, beside the bare transport
#[derive(Args, Debug)]
pub struct Latency {
    /// Transports; all unless given
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    bus: Vec<Bus>,
    /// Ways of waiting; all unless given
    #[arg(long, value_name = "MODE", value_delimiter = ',')]
    wait: Vec<Waiting>,
    /// Rounds, in which everything has its turn
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    rounds: u64,
    /// Round trips in each round
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u64).range(10..=10_000_000))]
    samples: u64,
    /// Find the highest sample rate that is held in real time without a missed deadline
    #[arg(long, conflicts_with_all = ["rounds", "samples", "hdr"])]
    rate: bool,
    /// With --rate: for how many seconds a rate must be held
    #[arg(long, value_name = "SECONDS", default_value_t = 10, requires = "rate", value_parser = clap::value_parser!(u64).range(1..=3600))]
    hold: u64,
    #[command(flatten)]
    realtime: LoopRealtime,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Write each distribution to a file in HdrHistogram's text form
    #[arg(long, value_name = "DIR")]
    hdr: Option<PathBuf>,
}

/// Answer the bare transport's round trips until standard input closes
#[derive(Debug, Parser)]
#[command(name = "mtj echo")]
pub struct Echo {
    #[arg(long)]
    bus: Bus,
    #[arg(long)]
    wait: Waiting,
    #[arg(long)]
    place: String,
    #[command(flatten)]
    realtime: RealtimeOptions,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Bus {
    Iceoryx2,
    Zenoh,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Waiting {
    Spin,
    Block,
    Hybrid,
}

impl From<Bus> for BusKind {
    fn from(bus: Bus) -> Self {
        match bus {
            Bus::Iceoryx2 => Self::Iceoryx2,
            Bus::Zenoh => Self::Zenoh,
        }
    }
}

impl From<Waiting> for Wait {
    fn from(wait: Waiting) -> Self {
        match wait {
            Waiting::Spin => Self::Spin,
            Waiting::Block => Self::Block,
            Waiting::Hybrid => Self::Hybrid(DEFAULT_SPIN),
        }
    }
}

impl Latency {
    /// Measures and prints.
    pub fn run(self) -> Result<(), Failure> {
        let shutdown = Shutdown::on_signals();
        let proceed = || shutdown.proceed();
        let all = |given: &[Bus]| {
            if given.is_empty() { Bus::value_variants().to_vec() } else { given.to_vec() }
        };
        let waits = if self.wait.is_empty() { Waiting::value_variants() } else { &self.wait };
        let ways: Vec<Way> = all(&self.bus)
            .into_iter()
            .flat_map(|bus| {
                waits.iter().map(move |wait| Way { bus: bus.into(), wait: (*wait).into() })
            })
            .collect();
        let effort = Effort {
            rounds: self.rounds as usize,
            samples: self.samples,
            realtime: self.realtime.clone(),
        };
        if self.rate {
            return self.find_rates(&ways, &effort, &proceed);
        }
        if let Some(directory) = &self.hdr {
            fs::create_dir_all(directory).map_err(|error| {
                Failure::bad_input(format!(
                    "--hdr {}: {error}; name a directory that can be made",
                    directory.display()
                ))
            })?;
        }
        let measured = round_trip::measure(&ways, &effort, &proceed)?;
        if let Some(directory) = &self.hdr {
            for Measurement { way, own, bare, .. } in &measured {
                for (trips, what) in [(own, "loop"), (bare, "bare")] {
                    let name = format!("{}-{}-{what}.hgrm", way.bus.name(), way.wait.name());
                    let mut file = BufWriter::new(File::create(directory.join(name))?);
                    print::hdr(&mut file, &trips.all)?;
                    file.flush()?;
                }
            }
        }
        let mut out = io::stdout().lock();
        if self.json {
            let rows: Vec<_> = measured.iter().filter_map(Measurement::row).collect();
            serde_json::to_writer(&mut out, &rows).map_err(io::Error::from)?;
            writeln!(out)?;
        } else {
            print::table(&mut out, &measured, &effort)?;
        }
        Ok(())
    }

    fn find_rates(
        &self,
        ways: &[Way],
        effort: &Effort,
        proceed: Proceed<'_>,
    ) -> Result<(), Failure> {
        let mut attempts = Vec::new();
        let hold = Duration::from_secs(self.hold);
        for way in ways {
            let name = format!("{} {}", way.bus.name(), way.wait.name());
            let mut note = |held: &round_trip::Held| {
                let verdict = if held.is_held { "held" } else { "not held" };
                let _ = writeln!(
                    io::stderr(),
                    "{name}: {:.0} Hz {verdict} for {} s ({} deadlines missed, {} commands lost, {} late)",
                    held.rate_hz,
                    self.hold,
                    held.deadline_misses,
                    held.lost,
                    held.late
                );
                attempts.push(held.clone());
            };
            let highest = round_trip::highest_rate(*way, hold, effort, proceed, &mut note)?;
            match (self.json, highest) {
                (true, _) => {}
                (false, Some(rate)) => writeln!(io::stdout(), "{name}: {rate:.0} Hz")?,
                (false, None) => writeln!(io::stdout(), "{name}: no rate was held")?,
            }
        }
        if self.json {
            let mut out = io::stdout().lock();
            serde_json::to_writer(&mut out, &attempts).map_err(io::Error::from)?;
            writeln!(out)?;
        }
        Ok(())
    }
}

impl Echo {
    /// Answers.
    pub fn run(self) -> Result<(), Failure> {
        // First, so that a thread that spins at a high priority does not keep this one from
        // running.
        let shutdown = Shutdown::on_signals().when_stdin_closes();
        let realtime = Realtime::from(&self.realtime);
        realtime.before_joining();
        realtime.before_the_loop()?;
        round_trip::echo(self.bus.into(), self.wait.into(), &self.place, &|| shutdown.proceed())
    }
}
