//! `mtj replay`: a recording played to a controller.

use std::{
    io::{self, Write},
    path::PathBuf,
};

use clap::Args;
use mtj_model::scenario::Override;
use mtj_monitor::recording::Recording;

use super::Failure;
use crate::replay;

/// Feed recorded states to a controller and compare its torques with the recorded ones, bit for bit
#[derive(Args, Debug)]
pub struct Replay {
    /// A recording
    #[arg(value_name = "FILE.mcap")]
    recording: PathBuf,
    /// Answer under another law: set a key of the recorded scenario, like law.kind=tj
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

impl Replay {
    /// Prints what differs.
    pub fn run(self) -> Result<(), Failure> {
        let mut recording = Recording::open(&self.recording).map_err(Failure::bad_input)?;
        let set = self.set.iter().map(|text| text.parse()).collect::<Result<Vec<Override>, _>>()?;
        let findings = replay::replay(&mut recording, &set).map_err(Failure::bad_input)?;
        let mut out = io::stdout().lock();
        if self.json {
            serde_json::to_writer(&mut out, &findings).map_err(io::Error::from)?;
            writeln!(out)?;
        } else {
            write!(out, "{findings}")?;
        }
        Ok(())
    }
}
