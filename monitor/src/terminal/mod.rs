//! The dashboard in the terminal.
//!
//! ```text
//! dashboard  a sink: draws ten times a second, and reacts to keys
//! panel      what is on the screen
//! view       what is drawn: the overview, and the last minutes
//! envelope   a number over time, reduced without losing a peak
//! screen     the terminal: its set-up, its frames and its restoration
//! keyboard   the keys
//! log_layer  log lines on the dashboard
//! palette    the colours
//! error      why the terminal cannot show a dashboard
//! ```

mod dashboard;
mod envelope;
mod error;
mod keyboard;
mod log_layer;
mod palette;
mod panel;
mod screen;
mod view;

use std::{
    env,
    io::{IsTerminal, stdout},
};

use clap::Args;
use mtj_model::scenario::BusSettings;

pub use self::{dashboard::Dashboard, error::TerminalError, log_layer::log_layer};

/// The options of the terminal dashboard.
#[derive(Args, Clone, Debug, Default)]
pub struct TerminalOptions {
    /// Show a dashboard in this terminal instead of one line a second
    #[arg(long)]
    pub tui: bool,
}

impl TerminalOptions {
    /// Checks that a dashboard that the user asked for can be shown.
    pub fn check(&self) -> Result<(), TerminalError> {
        if !self.tui {
            Ok(())
        } else if !stdout().is_terminal() {
            Err(TerminalError::NotATerminal)
        } else if env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb") {
            Err(TerminalError::UnknownTerminal)
        } else {
            Ok(())
        }
    }

    /// Opens the dashboard, if the user asked for it.
    pub fn open(&self, bus: &BusSettings) -> Result<Option<Dashboard>, TerminalError> {
        if !self.tui {
            return Ok(None);
        }
        let session = format!("{} over {}", bus.session, bus.kind.name());
        Ok(Some(Dashboard::open(session).map_err(TerminalError::Open)?))
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        if self.tui { vec!["--tui".to_owned()] } else { Vec::new() }
    }
}
