//! Why a monitor could not start or go on.

use std::error::Error;

use mtj_model::scenario::ScenarioError;
use mtj_protocol::bus::BusError;

/// Why a monitor could not start or go on.
#[derive(Debug, thiserror::Error)]
pub enum MonitorError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The options that name the bus are wrong.
    #[error(transparent)]
    Options(#[from] ScenarioError),
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
    /// Bad input of a display or a recording: an address in use, a file that is there already.
    #[error(transparent)]
    BadInput(Box<dyn Error + Send + Sync>),
    /// A display or a recording failed.
    #[error(transparent)]
    Failed(Box<dyn Error + Send + Sync>),
}

impl MonitorError {
    /// The error of a display or a recording, as bad input or as a failure.
    pub fn of(error: impl Into<Box<dyn Error + Send + Sync>>, is_bad_input: bool) -> Self {
        if is_bad_input { Self::BadInput(error.into()) } else { Self::Failed(error.into()) }
    }

    /// Whether the user can remedy it: the exit status is then 2, otherwise 1.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Bus(error) => error.is_bad_input(),
            Self::Options(_) | Self::OneSessionOnly { .. } | Self::BadInput(_) => true,
            Self::Failed(_) => false,
        }
    }
}
