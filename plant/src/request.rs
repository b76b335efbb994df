//! Requests of operators: each is carried out once, and answered as often as it comes.

use std::collections::VecDeque;

use mtj_model::scenario::{Override, Scenario};
use mtj_protocol::{
    request::Request,
    sample::{ChangeSample, Header, Joints, RequestSample, padded},
};

use crate::error::Refusal;

/// How many requests are handled at a time, so that a flood of them does not hold up the loop.
pub(crate) const AT_A_TIME: usize = 8;
/// How many answers are kept for requests that come again.
const REMEMBERED: usize = 64;

/// A loop that requests can change between two samples.
pub(crate) trait Changeable {
    /// The current scenario.
    fn scenario(&self) -> &Scenario;
    /// Goes on with a changed scenario.
    fn change(&mut self, scenario: Scenario) -> Result<(), Refusal>;
    /// Disturbs the arm with a torque, N m, for so long.
    fn disturb(&mut self, torque: Joints, duration_ns: u64);
    /// Pauses the run, or resumes it.
    fn pause(&mut self, is_paused: bool);
    /// Ends the run; another one follows.
    fn reset(&mut self);
}

/// Carries out a request.
pub(crate) fn carry_out(
    request: &RequestSample,
    target: &mut impl Changeable,
) -> Result<(), Refusal> {
    match Request::from_sample(request)? {
        Request::Set(sets) => {
            let sets: Vec<Override> =
                sets.iter().map(|set| set.parse()).collect::<Result<_, _>>()?;
            let scenario = target.scenario().changed(&sets)?;
            target.change(scenario)?;
        }
        Request::Pause => target.pause(true),
        Request::Resume => target.pause(false),
        Request::Reset => target.reset(),
        Request::Kick { torque, milliseconds } => {
            target.disturb(padded(&torque), (milliseconds * 1e6).round() as u64);
        }
    }
    Ok(())
}

/// The answers to the newest requests.
#[derive(Default)]
pub(crate) struct Answers(VecDeque<ChangeSample>);

impl Answers {
    /// The answer to a request that was handled before.
    pub(crate) fn to(&self, request: &RequestSample) -> Option<ChangeSample> {
        self.0.iter().find(|change| change.request == request.header.sequence).copied()
    }

    /// Answers a request, and forgets the oldest answer if there is no room.
    pub(crate) fn answer(
        &mut self,
        header: Header,
        request: &RequestSample,
        outcome: Result<(), Refusal>,
    ) -> ChangeSample {
        let outcome = outcome.map_err(|refusal| refusal.to_string());
        let outcome = outcome.as_ref().map_err(String::as_str).copied();
        let change = ChangeSample::answer(header, request, outcome);
        if self.0.len() == REMEMBERED {
            self.0.pop_front();
        }
        self.0.push_back(change);
        change
    }
}
