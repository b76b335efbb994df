//! What the knobs of a run have been turned to, apart from the scenario.

use std::collections::VecDeque;

use mtj_protocol::sample::ChangeSample;

/// How many answers are remembered for whoever asks again.
const REMEMBERED: usize = 64;

/// The knobs of a run.
#[derive(Default)]
pub(crate) struct Knobs {
    pub is_paused: bool,
    pub is_reset: bool,
    /// Counts kicks, so that only the end of the newest one ends it.
    pub kicks: u64,
    answers: VecDeque<ChangeSample>,
}

impl Knobs {
    /// What became of a request that was dealt with before.
    pub fn answer_to(&self, request: u64) -> Option<ChangeSample> {
        self.answers.iter().find(|change| change.request == request).copied()
    }

    /// Keeps what became of a request, in place of the oldest if there is no room.
    pub fn remember(&mut self, change: ChangeSample) {
        if self.answers.len() == REMEMBERED {
            self.answers.pop_front();
        }
        self.answers.push_back(change);
    }
}
