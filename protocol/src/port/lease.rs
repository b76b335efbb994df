//! The election of the leader: the one controller whose torques the plant accepts.
//!
//! The plant elects, and names the leader in every state. The leader holds a *lease*, which it
//! renews by answering. If it leaves a state unanswered for longer than the lease lasts, or the bus
//! notices before that it is gone, the plant elects another: the controller with the highest
//! precedence, among those the one that joined first. A controller that answers is never replaced,
//! and torques of all others are rejected, so two controllers never alternate.

use std::{
    cmp::Reverse,
    time::{Duration, Instant},
};

use crate::{
    bus::{Attendance, BusError},
    member::{Member, Role},
};

/// How often to look for a controller while there is none, or none that answers.
const LOOK: Duration = Duration::from_millis(10);
/// For how long a controller that did not answer comes last in elections: if all are slower than
/// the lease, each leads for at least as long.
const DISTRUST: Duration = Duration::from_secs(1);

/// The leader of one run, and its lease.
pub(super) struct Lease {
    duration: Duration,
    attendance: Box<dyn Attendance>,
    /// The controller that leads; without one, any controller may answer.
    leader: Option<u64>,
    /// The leader, if it was elected, as it announced itself.
    elected: Option<Member>,
    /// Since when a state has been waiting for the leader's answer.
    waiting: Option<Instant>,
    looked: Option<Instant>,
    /// The leader that did not answer, if there was one, and when it was replaced.
    deposed: Option<(Option<u64>, Instant)>,
    /// The controller that answered last.
    answered: Option<u64>,
    takeovers: u64,
}

impl Lease {
    /// A lease without a leader.
    pub(super) fn new(duration: Duration, attendance: Box<dyn Attendance>) -> Self {
        Self {
            duration,
            attendance,
            leader: None,
            elected: None,
            waiting: None,
            looked: None,
            deposed: None,
            answered: None,
            takeovers: 0,
        }
    }

    /// Changes how long a lease lasts.
    pub(super) fn reconfigure(&mut self, duration: Duration) {
        self.duration = duration;
    }

    /// Begins another run: the leader stays, but has to prove itself again.
    pub(super) fn restart(&mut self) {
        self.waiting = None;
        self.answered = None;
        self.takeovers = 0;
    }

    /// Decides which controller must answer the next state.
    pub(super) fn decide(&mut self) -> Result<Option<u64>, BusError> {
        // The clock is read only when it matters: a leader that has answered stays.
        if self.leader.is_none() || self.waiting.is_some() {
            let now = Instant::now();
            let has_lapsed =
                self.waiting.is_some_and(|since| now.duration_since(since) >= self.duration);
            let may_look = self.looked.is_none_or(|looked| now.duration_since(looked) >= LOOK);
            if ((self.leader.is_none() || has_lapsed) && may_look) || self.has_left()? {
                self.looked = Some(now);
                self.elect(now)?;
            }
        }
        Ok(self.leader)
    }

    /// Records that a state was sent `now`, for the leader to answer.
    pub(super) fn sent(&mut self, now: Instant) {
        self.waiting.get_or_insert(now);
    }

    /// The controller that must answer the state that was sent last.
    pub(super) fn leader(&self) -> Option<u64> {
        self.leader
    }

    /// Whether the leader has answered before.
    pub(super) fn is_proven(&self) -> bool {
        self.leader.is_some() && self.leader == self.answered
    }

    /// When the leader's lease lapses, if it does not answer before.
    pub(super) fn lapse(&self) -> Option<Instant> {
        let lapse = self.waiting.filter(|_| self.leader.is_some())? + self.duration;
        Some(self.looked.map_or(lapse, |looked| lapse.max(looked + LOOK)))
    }

    /// Whether an answer of this controller may be admitted.
    pub(super) fn allows(&self, controller: u64) -> bool {
        self.leader.is_none_or(|leader| leader == controller)
    }

    /// Renews the lease after an answer of this controller; without an elected leader, it becomes
    /// the leader.
    pub(super) fn renew(&mut self, controller: u64) {
        self.leader = Some(controller);
        self.waiting = None;
        self.takeovers += u64::from(self.answered.is_some_and(|before| before != controller));
        self.answered = Some(controller);
    }

    /// How often the leader changed.
    pub(super) fn takeovers(&self) -> u64 {
        self.takeovers
    }

    /// Whether the bus knows that the elected leader is gone: then there is nothing to wait for.
    fn has_left(&mut self) -> Result<bool, BusError> {
        let Some(member) = &self.elected else { return Ok(false) };
        Ok(!self.attendance.is_present(member)?)
    }

    /// Elects the best controller that is present, and the one that did not answer only if there is
    /// no other.
    fn elect(&mut self, now: Instant) -> Result<(), BusError> {
        let silent = self.leader;
        let distrusted = self
            .deposed
            .filter(|(_, since)| now.duration_since(*since) < DISTRUST)
            .and_then(|(controller, _)| controller);
        let trust = |member: &Member| match Some(member.id) {
            id if id == distrusted => 0,
            id if id == silent => 1,
            _ => 2,
        };
        let present = self.attendance.present()?;
        let controllers = present.iter().filter(|member| member.role == Role::Controller);
        let best = controllers.max_by_key(|member| {
            (trust(member), member.precedence, Reverse((member.since_ns, member.id)))
        });
        // If no controller has announced itself, any may answer.
        self.leader = best.map(|member| member.id);
        self.elected = best.copied();
        if self.leader != silent {
            self.waiting = None;
            self.deposed = Some((silent, now));
        }
        Ok(())
    }
}
