//! The book-keeping of a run: what was asked for, what came of it, and how long it took.

use std::{collections::VecDeque, time::Duration};

use mtj_protocol::sample::TorqueSample;
use serde::{Deserialize, Serialize};

use crate::{clock::Clock, durations::Durations};

/// How many unanswered states are remembered; older ones count as lost.
const OUTSTANDING: usize = 4096;

/// What became of the commands that the plant asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Commands {
    /// States handed to the controller, each asking for a command.
    pub sent: u64,
    /// Commands that came into effect.
    pub applied: u64,
    /// Commands that never came, or that a newer one had overtaken.
    pub lost: u64,
    /// Commands that came more than a sample period after their state was sent.
    pub late: u64,
    /// Torque samples that were not acceptable.
    pub rejected: u64,
}

/// The book of a run.
pub struct Ledger {
    /// The counts so far.
    pub commands: Commands,
    /// Sampling instants reached only after the next was due.
    pub deadline_misses: u64,
    /// How often commands stayed away for longer than the command timeout.
    pub timeouts: u64,
    /// The longest time without a fresh command, ns of the run.
    pub longest_gap_ns: u64,
    applied_ns: u64,
    /// State sent to torque received, of the torque received last, ns.
    pub round_trip_ns: u64,
    /// The part of it spent inside the controller.
    pub residence_ns: u64,
    /// Stamps what is sent.
    pub stopwatch: Clock,
    /// All round trips.
    pub round_trips: Durations,
    /// All residence times.
    pub residences: Durations,
    /// States waiting for an answer in real time: sequence number and when they were sent.
    unanswered: VecDeque<(u64, u64)>,
}

impl Ledger {
    /// Nothing booked yet.
    pub fn new() -> Self {
        Self {
            commands: Commands::default(),
            deadline_misses: 0,
            timeouts: 0,
            longest_gap_ns: 0,
            applied_ns: 0,
            round_trip_ns: 0,
            residence_ns: 0,
            stopwatch: Clock::start(),
            round_trips: Durations::default(),
            residences: Durations::default(),
            unanswered: VecDeque::with_capacity(OUTSTANDING + 1),
        }
    }

    /// Notes how long an answer took that has just come.
    pub fn note_round_trip(&mut self, answer: &TorqueSample) {
        self.round_trip_ns = self.stopwatch.now_ns().saturating_sub(answer.state_sent_ns);
        self.residence_ns = answer.residence_ns;
        self.round_trips.record(self.round_trip_ns);
        self.residences.record(self.residence_ns);
    }

    /// A command came into effect.
    pub fn apply(&mut self, time_ns: u64) {
        self.commands.applied += 1;
        self.note_gap(time_ns);
    }

    fn note_gap(&mut self, time_ns: u64) {
        self.longest_gap_ns = self.longest_gap_ns.max(time_ns.saturating_sub(self.applied_ns));
        self.applied_ns = time_ns;
    }

    /// In real time: a state was sent that asks for an answer.
    pub fn ask(&mut self, sequence: u64) {
        if self.unanswered.len() == OUTSTANDING {
            self.unanswered.pop_front();
            self.commands.lost += 1;
        }
        self.unanswered.push_back((sequence, self.stopwatch.now_ns()));
    }

    /// In real time: books an answer, whose round trip was noted, against the states that asked for one.
    pub fn answer(&mut self, sequence: u64, sample_period: Duration) {
        if u128::from(self.round_trip_ns) > sample_period.as_nanos() {
            self.commands.late += 1;
        }
        while let Some((asked, _)) = self.unanswered.front().copied()
            && asked <= sequence
        {
            self.unanswered.pop_front();
            self.commands.lost += u64::from(asked < sequence);
        }
    }

    /// At the end, `time_ns`: what was asked for more than a sample period ago and has not come, will
    /// not come.
    pub fn settle(&mut self, time_ns: u64, sample_period: Duration) {
        self.note_gap(time_ns);
        let now = u128::from(self.stopwatch.now_ns());
        let is_lost = |sent_ns: u64| now > u128::from(sent_ns) + sample_period.as_nanos();
        let lost = self.unanswered.iter().filter(|(_, sent_ns)| is_lost(*sent_ns)).count();
        self.commands.lost += lost as u64;
    }
}

impl Default for Ledger {
    fn default() -> Self {
        Self::new()
    }
}
