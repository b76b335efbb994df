//! Where a monitor shows and records what it receives.

use clap::Args;
#[cfg(feature = "foxglove")]
use mtj_monitor::foxglove::FoxgloveOptions;
use mtj_monitor::{
    filter::FilterOptions, recording::options::RecordingOptions, terminal::TerminalOptions,
    web::WebOptions,
};

/// Where a monitor shows and records what it receives
#[derive(Args, Clone, Debug, Default)]
pub struct AudienceOptions {
    /// The dashboard in a browser.
    #[command(flatten)]
    pub web: WebOptions,
    /// The dashboard in the terminal, instead of a line a second.
    #[command(flatten)]
    pub terminal: TerminalOptions,
    /// A file.
    #[command(flatten)]
    pub recording: RecordingOptions,
    /// Which samples all of these get.
    #[command(flatten)]
    pub filter: FilterOptions,
    /// Foxglove.
    #[cfg(feature = "foxglove")]
    #[command(flatten)]
    pub foxglove: FoxgloveOptions,
}

impl AudienceOptions {
    /// The same options as arguments for another process.
    pub fn arguments(&self) -> Vec<String> {
        [
            self.web.arguments(),
            self.terminal.arguments(),
            self.recording.arguments(),
            self.filter.arguments(),
            #[cfg(feature = "foxglove")]
            self.foxglove.arguments(),
        ]
        .concat()
    }
}
