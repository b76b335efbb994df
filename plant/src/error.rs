//! Why a plant stops before it is done, and why it refuses a request.

use std::{io, path::PathBuf, time::Duration};

use mtj_model::{
    scenario::{ScenarioError, duration},
    table::TableError,
};
use mtj_protocol::{bus::BusError, request::RequestError};

/// Why a plant stopped before it was done.
#[derive(Debug, thiserror::Error)]
pub enum PlantError {
    /// The scenario is not accepted.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A link of the scenario cannot be emulated.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The results could not be written.
    #[error("the results could not be written: {0}")]
    Output(#[from] io::Error),
}

impl PlantError {
    /// Whether the user asked for something that cannot be: exit status 2.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Scenario(_) | Self::Link(_) => true,
            Self::Bus(error) => error.is_bad_input(),
            Self::Output(_) => false,
        }
    }
}

/// Why a link cannot be emulated. All of these are bad input.
#[derive(Debug, thiserror::Error)]
pub enum LinkError {
    /// No such distribution can be drawn from.
    #[error("link.{direction}.jitter: no distribution has this mean and deviation; choose others")]
    Jitter {
        /// `state` or `torque`.
        direction: &'static str,
    },
    /// No command could be young enough to act.
    #[error(
        "safety.command_timeout = \"{}\" is not accepted: expected {reason}",
        duration::format(*timeout)
    )]
    TooOld {
        /// The timeout.
        timeout: Duration,
        /// What would be accepted, and why.
        reason: String,
    },
    /// The file of a replay cannot be read.
    #[error("the replayed latencies {} cannot be read: {source}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        source: TableError,
    },
    /// The header names no column of latencies.
    #[error(
        "{}: the first line names no column latency_s, latency_ms, latency_us or latency_ns; it names \
         '{found}'",
        file.display()
    )]
    NoColumn {
        /// The file.
        file: PathBuf,
        /// What the first line names.
        found: String,
    },
    /// A line has something else than a latency.
    #[error(
        "{}, line {line}: '{value}' is not accepted: expected a latency, a number 0 or greater, or \
         lost",
        file.display()
    )]
    Latency {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// What stands there.
        value: String,
    },
    /// There is nothing to replay.
    #[error("{}: there are no latencies after the header", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
}

/// Why a request is not carried out. The run goes on as before.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Refusal {
    /// No plant could do this.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// The scenario would not be accepted.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A link of the scenario could not be emulated.
    #[error(transparent)]
    Link(#[from] LinkError),
}
