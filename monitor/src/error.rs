//! Why a monitor could not start or go on.

use mtj_model::scenario::ScenarioError;
use mtj_protocol::bus::BusError;

#[cfg(feature = "foxglove")]
use crate::foxglove::FoxgloveError;
use crate::{
    fleet::PatternError, recording::RecordingError, terminal::TerminalError, web::WebError,
};

/// Why a monitor could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum MonitorError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The options that name the bus are wrong.
    #[error(transparent)]
    Options(#[from] ScenarioError),
    /// The pattern of session names is wrong.
    #[error(transparent)]
    Pattern(#[from] PatternError),
    /// An option was given that works for one session only.
    #[error(
        "--session '{pattern}' means many sessions, and {flag} is for one; name one, or leave out \
         {flag} for a table of all"
    )]
    OneSessionOnly {
        /// The pattern.
        pattern: String,
        /// The option.
        flag: String,
    },
    /// The terminal cannot be drawn on.
    #[error(transparent)]
    Terminal(#[from] TerminalError),
    /// A recording cannot be written or read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The dashboard cannot be served.
    #[error(transparent)]
    Web(#[from] WebError),
    /// Foxglove cannot be served.
    #[cfg(feature = "foxglove")]
    #[error(transparent)]
    Foxglove(#[from] FoxgloveError),
}

impl MonitorError {
    /// Whether the user can remedy it: the exit status is then 2, otherwise 1.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Bus(error) => error.is_bad_input(),
            Self::Terminal(error) => error.is_bad_input(),
            Self::Recording(error) => error.is_bad_input(),
            Self::Web(error) => error.is_bad_input(),
            Self::Options(_) | Self::Pattern(_) | Self::OneSessionOnly { .. } => true,
            #[cfg(feature = "foxglove")]
            Self::Foxglove(_) => true,
        }
    }
}
