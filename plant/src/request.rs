//! Requests of operators: each is carried out once, and answered as often as it comes.

use std::{
    collections::VecDeque,
    io,
    sync::mpsc::{self, Receiver, SyncSender},
    thread,
    time::Duration,
};

use mtj_model::scenario::{Override, Scenario};
use mtj_protocol::{
    realtime,
    request::Request,
    sample::{ChangeSample, Header, Joints, RequestSample, padded},
};

use crate::{error::Refusal, gravity::GravityTerms, link::LinkChanges};

/// How many requests are handled at a time, so that a flood of them does not hold up the loop.
pub(crate) const AT_A_TIME: usize = 8;
/// How many requests are prepared at a time at most.
pub(crate) const PENDING: usize = 16;
/// How many answers are kept for requests that come again.
const REMEMBERED: usize = 64;

/// A loop that requests can change between two samples.
pub(crate) trait Changeable {
    /// Goes on with a changed scenario.
    fn change(&mut self, change: Change);
    /// Disturbs the arm with a torque, N m, for so long.
    fn disturb(&mut self, torque: Joints, duration_ns: u64);
    /// Pauses the run, or resumes it.
    fn pause(&mut self, is_paused: bool);
    /// Ends the run; another one follows.
    fn reset(&mut self);
}

/// A changed scenario with all that follows from it.
pub(crate) struct Change {
    pub(crate) scenario: Scenario,
    pub(crate) links: LinkChanges,
    pub(crate) gravity_terms: GravityTerms,
}

/// A request that can be carried out without any more work.
pub(crate) enum Prepared {
    Change(Box<Change>),
    Pause(bool),
    Reset,
    Kick { torque: Joints, duration_ns: u64 },
}

impl Prepared {
    /// Reads a request to a loop with the scenario `current`, checks it, and reads the files that it
    /// names. Takes as long as that takes.
    fn of(request: &RequestSample, current: &Scenario) -> Result<Self, Refusal> {
        Ok(match Request::from_sample(request)? {
            Request::Set(sets) => {
                let sets: Vec<Override> =
                    sets.iter().map(|set| set.parse()).collect::<Result<_, _>>()?;
                let scenario = current.changed(&sets)?;
                let links = LinkChanges::between(current, &scenario)?;
                let gravity_terms = GravityTerms::new(&scenario);
                Self::Change(Box::new(Change { scenario, links, gravity_terms }))
            }
            Request::Pause => Self::Pause(true),
            Request::Resume => Self::Pause(false),
            Request::Reset => Self::Reset,
            Request::Kick { torque, milliseconds } => Self::Kick {
                torque: padded(&torque),
                duration_ns: (milliseconds * 1e6).round() as u64,
            },
        })
    }

    /// Carries it out.
    pub(crate) fn carry_out(self, target: &mut impl Changeable) {
        match self {
            Self::Change(change) => target.change(*change),
            Self::Pause(is_paused) => target.pause(is_paused),
            Self::Reset => target.reset(),
            Self::Kick { torque, duration_ns } => target.disturb(torque, duration_ns),
        }
    }
}

/// A thread that prepares requests, so that the loop does not: a scenario has to be read and
/// checked, and may name files.
pub(crate) struct Preparer {
    requests: SyncSender<RequestSample>,
    prepared: Receiver<(RequestSample, Result<Prepared, Refusal>)>,
    /// How many requests it has.
    pending: usize,
}

impl Preparer {
    /// Starts the thread for a loop with this scenario. It ends with the preparer.
    pub(crate) fn start(scenario: &Scenario) -> io::Result<Self> {
        let (requests, incoming) = mpsc::sync_channel::<RequestSample>(PENDING);
        let (outgoing, prepared) = mpsc::sync_channel(PENDING);
        let mut current = scenario.clone();
        let prepare = move || {
            realtime::leave_the_loop();
            for request in incoming {
                let outcome = Prepared::of(&request, &current);
                if let Ok(Prepared::Change(change)) = &outcome {
                    let before = current.advice();
                    let news = change.scenario.advice();
                    for advice in news.iter().filter(|advice| !before.contains(advice)) {
                        tracing::warn!("{advice}");
                    }
                    current = change.scenario.clone();
                }
                if outgoing.send((request, outcome)).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new().name("requests".to_owned()).spawn(prepare)?;
        Ok(Self { requests, prepared, pending: 0 })
    }

    /// Whether it can take another request.
    pub(crate) fn has_room(&self) -> bool {
        self.pending < PENDING
    }

    /// Hands over a request; false if that is not possible.
    pub(crate) fn submit(&mut self, request: &RequestSample) -> bool {
        let is_taken = self.requests.try_send(*request).is_ok();
        self.pending += usize::from(is_taken);
        is_taken
    }

    /// The next request that is prepared, if there is one; with `patience`, waits for it.
    pub(crate) fn take(
        &mut self,
        patience: Duration,
    ) -> Option<(RequestSample, Result<Prepared, Refusal>)> {
        if self.pending == 0 {
            return None;
        }
        let taken = match patience {
            Duration::ZERO => self.prepared.try_recv().ok(),
            patience => self.prepared.recv_timeout(patience).ok(),
        };
        self.pending -= usize::from(taken.is_some());
        taken
    }
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
