//! Which of several controllers is in charge: the plant decides, and names it in every state.
//!
//! The controller in charge holds a *lease*, which it renews by answering. If it leaves a state unanswered
//! for longer than the lease lasts, or the bus notices before that it is gone, the best of the others takes over:
//! the one of the highest precedence, among those the one that has been there longest. Nobody takes over from a
//! controller that answers, and torques of any other are refused, so two controllers never alternate.

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
/// For how long a controller that did not answer comes last: where all are slower than the lease
/// allows, each is in charge for at least as long.
const DISTRUST: Duration = Duration::from_secs(1);

/// The charge of one run.
pub struct Lease {
    duration: Duration,
    attendance: Box<dyn Attendance>,
    leader: u64,
    /// The leader, if it was appointed, as it announced itself.
    appointed: Option<Member>,
    /// Since when a state has been waiting for the leader's answer.
    waiting: Option<Instant>,
    looked: Option<Instant>,
    /// Who did not answer, and when that was noticed.
    deposed: Option<(u64, Instant)>,
    /// The controller that answered last.
    before: u64,
    takeovers: u64,
}

impl Lease {
    /// Nobody is in charge yet.
    pub fn new(duration: Duration, attendance: Box<dyn Attendance>) -> Self {
        Self {
            duration,
            attendance,
            leader: 0,
            appointed: None,
            waiting: None,
            looked: None,
            deposed: None,
            before: 0,
            takeovers: 0,
        }
    }

    /// From now on a lease lasts so long.
    pub fn reconfigure(&mut self, duration: Duration) {
        self.duration = duration;
    }

    /// Another run begins: who is in charge stays so, but has to prove himself anew.
    pub fn restart(&mut self) {
        self.waiting = None;
        self.before = 0;
        self.takeovers = 0;
    }

    /// Decides who is to answer the next state; 0 for anybody.
    pub fn decide(&mut self) -> Result<u64, BusError> {
        // The clock is read only when it matters: a controller in charge that has answered stays so.
        if self.leader == 0 || self.waiting.is_some() {
            let now = Instant::now();
            let has_lapsed =
                self.waiting.is_some_and(|since| now.duration_since(since) >= self.duration);
            let may_look = self.looked.is_none_or(|looked| now.duration_since(looked) >= LOOK);
            if ((self.leader == 0 || has_lapsed) && may_look) || self.has_left()? {
                self.looked = Some(now);
                self.appoint(now)?;
            }
        }
        Ok(self.leader)
    }

    /// A state was sent `now`, for the controller in charge to answer.
    pub fn asked(&mut self, now: Instant) {
        self.waiting.get_or_insert(now);
    }

    /// Who is to answer the state that was sent last.
    pub fn leader(&self) -> u64 {
        self.leader
    }

    /// Whether the controller in charge has answered before.
    pub fn is_proven(&self) -> bool {
        self.leader != 0 && self.leader == self.before
    }

    /// When the lease of the controller in charge lapses, if it does not answer before.
    pub fn lapse(&self) -> Option<Instant> {
        let lapse = self.waiting.filter(|_| self.leader != 0)? + self.duration;
        Some(self.looked.map_or(lapse, |looked| lapse.max(looked + LOOK)))
    }

    /// Whether an answer of this controller may pass.
    pub fn allows(&self, controller: u64) -> bool {
        self.leader == 0 || self.leader == controller
    }

    /// An answer of this controller has passed.
    pub fn answered(&mut self, controller: u64) {
        // Where none is appointed, a controller that answers is in charge.
        self.leader = controller;
        self.waiting = None;
        self.takeovers += u64::from(self.before != 0 && self.before != controller);
        self.before = controller;
    }

    /// How often another controller took charge.
    pub fn takeovers(&self) -> u64 {
        self.takeovers
    }

    /// Whether the bus knows that the appointed controller is gone: then nothing is to be waited for.
    fn has_left(&mut self) -> Result<bool, BusError> {
        let Some(member) = &self.appointed else { return Ok(false) };
        Ok(!self.attendance.is_present(member)?)
    }

    /// Puts the best of those who are present in charge, rather than the one that did not answer.
    fn appoint(&mut self, now: Instant) -> Result<(), BusError> {
        let silent = self.leader;
        let distrusted = self
            .deposed
            .filter(|(_, since)| now.duration_since(*since) < DISTRUST)
            .map(|(controller, _)| controller);
        let trust = |member: &Member| match member.id {
            id if Some(id) == distrusted => 0,
            id if id == silent => 1,
            _ => 2,
        };
        let present = self.attendance.present()?;
        let controllers = present.iter().filter(|member| member.role == Role::Controller);
        let best = controllers.max_by_key(|member| {
            (trust(member), member.precedence, Reverse((member.since_ns, member.id)))
        });
        // If none has announced itself, any answer is welcome.
        self.leader = best.map_or(0, |member| member.id);
        self.appointed = best.copied();
        if self.leader != silent {
            self.waiting = None;
            self.deposed = Some((silent, now));
        }
        Ok(())
    }
}
