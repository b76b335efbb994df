//! The terminal dashboard.
//!
//! ```text
//! dashboard       an audience: draws ten times a second, and listens to keys
//! panel           what is on the screen
//! view            what is known: the overview, and the last minutes
//! track           a number over time, thinned without losing a peak
//! screen          the terminal, taken over and given back
//! keyboard        the keys
//! stderr_capture  what is written to standard error meanwhile
//! palette         the colours
//! ```

mod dashboard;
mod keyboard;
mod palette;
mod panel;
mod screen;
mod stderr_capture;
mod track;
mod view;

use std::{
    env,
    io::{IsTerminal, stdout},
};

use clap::Args;
use mtj_model::scenario::BusSettings;
use mtj_protocol::bus::BusError;

pub use self::dashboard::Dashboard;

/// The options of the terminal dashboard.
#[derive(Args, Clone, Debug, Default)]
pub struct TerminalOptions {
    /// Show a dashboard in this terminal instead of one line a second
    #[arg(long)]
    pub tui: bool,
}

impl TerminalOptions {
    /// Refuses what cannot be, before anything is begun.
    pub fn check(&self) -> Result<(), BusError> {
        let refuse = |why: &str| {
            Err(BusError::Settings(format!(
                "--tui: the dashboard needs a terminal that can be drawn on, and {why}; without --tui \
                 there is one line a second"
            ).into()))
        };
        if !self.tui {
            Ok(())
        } else if !stdout().is_terminal() {
            refuse("standard output is none")
        } else if env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb") {
            refuse("TERM names none")
        } else {
            Ok(())
        }
    }

    /// Takes over the terminal, if that was asked for.
    pub fn open(&self, bus: &BusSettings) -> Result<Option<Dashboard>, BusError> {
        if !self.tui {
            return Ok(None);
        }
        let place = format!("{} over {}", bus.session, bus.kind.name());
        let dashboard = Dashboard::open(place).map_err(|error| {
            BusError::Transport(format!("--tui: no terminal to draw on: {error}").into())
        })?;
        Ok(Some(dashboard))
    }

    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        if self.tui { vec!["--tui".to_owned()] } else { Vec::new() }
    }
}
