//! Answers recorded states once more, and holds the answers against the recorded ones.
//!
//! ```text
//! pairs              which torque answered which state
//! replay_controller  the controller that answers once more
//! findings           what comes out of it
//! ```

mod findings;
mod pairs;
mod replay_controller;

use mtj_model::scenario::Override;
use mtj_monitor::recording::Recording;
use mtj_protocol::port::Message;

pub use self::findings::Findings;
use self::{pairs::Pairs, replay_controller::ReplayController};

/// Answers the states of a recording, with `set` laid over its scenarios.
pub fn replay(recording: &mut Recording, set: &[Override]) -> Result<Findings, String> {
    let mut findings = Findings::default();
    let mut pairs = Pairs::default();
    let mut controller = ReplayController::new(set);
    for recorded in &mut *recording {
        let message = recorded.map_err(|error| error.to_string())?.message;
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
        // A scenario may be heard a moment after the first samples that are about it.
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
