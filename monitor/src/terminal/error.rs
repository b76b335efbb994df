//! Why the terminal cannot show a dashboard.

use std::io;

use crate::error::MonitorError;

/// Why the terminal cannot show a dashboard.
#[derive(Debug, thiserror::Error)]
pub enum TerminalError {
    /// Standard output is a file or a pipe.
    #[error(
        "--tui: the dashboard needs a terminal that can be drawn on, and standard output is none; \
         without --tui there is one line a second"
    )]
    NotATerminal,
    /// The environment names no terminal that could be drawn on.
    #[error(
        "--tui: the dashboard needs a terminal that can be drawn on, and TERM names none; without \
         --tui there is one line a second"
    )]
    UnknownTerminal,
    /// The terminal cannot be opened.
    #[error("--tui: no terminal to draw on: {0}")]
    Open(io::Error),
    /// The terminal failed.
    #[error("the terminal failed: {0}")]
    Draw(io::Error),
}

impl From<TerminalError> for MonitorError {
    fn from(error: TerminalError) -> Self {
        let is_bad_input = error.is_bad_input();
        Self::of(error, is_bad_input)
    }
}

impl TerminalError {
    /// Whether the user can remedy it by another terminal or option.
    pub fn is_bad_input(&self) -> bool {
        matches!(self, Self::NotATerminal | Self::UnknownTerminal)
    }
}
