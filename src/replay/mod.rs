//! Answers recorded states once more and compares the answers with the recorded ones.
//!
//! ```text
//! pairs              which torque answered which state
//! replay_controller  the controller that answers once more
//! findings           how its answers compare
//! ```

mod findings;
mod pairs;
mod replay_controller;

use mtj_controller::LawError;
use mtj_model::scenario::{Override, ScenarioError};
use mtj_monitor::recording::{Recording, RecordingError};
use mtj_protocol::port::Message;

pub(crate) use self::findings::Findings;
use self::{findings::Instant, pairs::Pairs, replay_controller::ReplayController};

/// Why a recording cannot be answered.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReplayError {
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A recorded scenario is not acceptable with what is set in it.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The law has no answer to a state.
    #[error("at {at}: {source}")]
    Law {
        /// When.
        at: Instant,
        /// Why.
        source: LawError,
    },
}

/// Answers the states of a recording, with `set` laid over its scenarios.
pub(crate) fn replay(recording: &mut Recording, set: &[Override]) -> Result<Findings, ReplayError> {
    let mut findings = Findings::default();
    let mut pairs = Pairs::default();
    let mut controller = ReplayController::new(set);
    for recorded in &mut *recording {
        let message = recorded?.message;
        match &message {
            Message::Scenario(offered) => controller.learn(offered)?,
            Message::State(state) => {
                findings.states += 1;
                pairs.ask(*state);
            }
            Message::Torque(torque) => {
                findings.torques += 1;
                pairs.answer(*torque);
            }
            _ => {}
        }
        // A scenario may come a moment after the first samples that belong to it.
        while let Some(pair) = pairs.next(|header| controller.knows(header)) {
            controller.answer(&pair, &mut findings)?;
        }
    }
    while let Some(pair) = pairs.next(|_| true) {
        controller.answer(&pair, &mut findings)?;
    }
    pairs.finish();
    findings.repeated = pairs.repeated();
    findings.without_state = pairs.without_state();
    findings.cut_short = recording.is_cut_short();
    Ok(findings)
}
