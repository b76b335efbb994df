//! Why the dashboard cannot be served.

use std::io;

use super::token::TokenFileError;
use crate::error::MonitorError;

/// The address without another choice of the user.
pub(super) const DEFAULT: &str = "127.0.0.1:8080";

/// Why the dashboard cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum WebError {
    /// The address is not one.
    #[error("--web: '{text}' is no address; expected HOST:PORT, like {DEFAULT}")]
    Address {
        /// What the user wrote.
        text: String,
    },
    /// A name for the server is not a host name.
    #[error(
        "--web-host: '{name}' is no host name; expected a name without scheme and port, like \
         robot.lab"
    )]
    Host {
        /// What the user wrote.
        name: String,
    },
    /// An option of the dashboard was given, and no dashboard is served.
    #[error("{option} is for the dashboard; add --web to serve it")]
    WithoutDashboard {
        /// The option.
        option: &'static str,
    },
    /// The server cannot listen there.
    #[error(
        "--web: cannot listen on {host} port {port} ({source}); give another address, like {DEFAULT}"
    )]
    Listen {
        /// The host.
        host: String,
        /// The port.
        port: u16,
        /// Why.
        source: io::Error,
    },
    /// Other programs use all ports that were tried.
    #[error(
        "--web: all ports from {first} to {last} of {host} are in use; give another address, or \
         port 0 for any that is free"
    )]
    PortsInUse {
        /// The host.
        host: String,
        /// The first port that was tried.
        first: u16,
        /// The last one.
        last: u16,
    },
    /// A file has no token.
    #[error(transparent)]
    TokenFile(#[from] TokenFileError),
    /// The operating system has no random numbers.
    #[error("no random numbers for a token: {0}")]
    Token(getrandom::Error),
    /// The server cannot start.
    #[error("--web: cannot serve: {0}")]
    Serve(io::Error),
}

impl From<WebError> for MonitorError {
    fn from(error: WebError) -> Self {
        let is_bad_input = error.is_bad_input();
        Self::of(error, is_bad_input)
    }
}

impl WebError {
    /// Whether the user can remedy it by another option.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::Address { .. }
            | Self::Host { .. }
            | Self::WithoutDashboard { .. }
            | Self::Listen { .. }
            | Self::PortsInUse { .. }
            | Self::TokenFile(_) => true,
            Self::Token(_) | Self::Serve(_) => false,
        }
    }
}
