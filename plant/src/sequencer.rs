//! The rules of the loop, as a state machine without clock, transport and arm.
//!
//! The plant's event loop drives one [`Sequencer`], each lane of a sweep another. It is to be
//! called in order of time, and at one instant in the order of [`crate::agenda`].
//!
//! - **Meeting.** The first state is never lost on its link, because the two ends must meet.
//! - **Overtaking.** A state is not handed over if a newer one was; a command does not take effect
//!   if a newer one is in effect.
//! - **Arrival.** A torque sets out when its state was answered; its link says when it arrives, or
//!   loses it.
//! - **Hold.** The [`Actuator`] holds torque and echo; a command older than the command timeout
//!   does not take effect, and a timeout ends the hold. It counts from the instant at which a
//!   command took effect last, whatever the timeout was then.
//! - **Stall.** After a time for which the plant did not run, commands from before do not act.
//! - **Stop.** A joint that leaves its limits stops the arm: it brakes, and no command acts, until the
//!   stop is released.
//! - **Counting.** A state counts as sent when it is handed over, its command as lost, rejected or
//!   applied when that happens.
//! - **Divergence.** A joint speed of [`RUNAWAY`] or more, or one that is not a number, ends a run.

use mtj_model::{
    MAX_ECHO, MAX_JOINTS,
    scenario::{JointLimits, Scenario},
};
use serde::{Deserialize, Serialize};

use crate::{
    actuator::{Actuator, Command},
    durations::nanoseconds,
    error::LinkError,
    link::{Link, LinkChanges, Links},
};

/// A joint speed that no arm reaches, rad/s: from it on a run has diverged.
pub const RUNAWAY: f64 = 1e4;

/// Counts of the commands that the plant asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Commands {
    /// States handed to the controller, each asking for a command.
    pub sent: u64,
    /// Commands that came into effect.
    pub applied: u64,
    /// Commands that never came, or that a newer one had overtaken.
    pub lost: u64,
    /// Commands that were older than the command timeout when they came, or from before a stall, or
    /// that came while the arm was stopped.
    #[serde(default)]
    pub too_old: u64,
    /// Commands that came more than a sample period after their state was sent.
    pub late: u64,
    /// Torque samples that were not acceptable.
    pub rejected: u64,
}

/// What happens to an answer when it sets out for the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Departure {
    /// It arrives at this instant, ns.
    Arrives(u64),
    /// Its link loses it.
    Lost,
    /// It is not finite.
    Rejected,
}

/// The loop of an arm of `N` joints, or fewer, and a law with an echo of `E` numbers, or fewer.
#[derive(Debug)]
pub struct Sequencer<const N: usize = MAX_JOINTS, const E: usize = MAX_ECHO> {
    period_ns: u64,
    memory_step_ns: u64,
    timeout_ns: Option<u64>,
    state_link: Link,
    torque_link: Link,
    actuator: Actuator<N, E>,
    /// Number and instant of the sample that is taken next.
    next_sequence: u64,
    next_sample_ns: u64,
    /// Number of the newest state that was handed over.
    handed_over: Option<u64>,
    /// Number of the first sample whose command may act.
    acts_from: u64,
    /// When a command took effect last, ns; the run's beginning before any.
    applied_ns: u64,
    commands: Commands,
    timeouts: u64,
    has_diverged: bool,
    joint_limits: JointLimits,
    /// How a stop brakes, N m s/rad.
    damping: f64,
    /// Whether the arm was within its limits at the last look.
    is_within_limits: bool,
    is_stopped: bool,
}

impl<const N: usize, const E: usize> Sequencer<N, E> {
    /// Before the first sample.
    pub fn new(scenario: &Scenario) -> Result<Self, LinkError> {
        let Links { state, torque } = Links::new(scenario)?;
        Ok(Self {
            period_ns: nanoseconds(scenario.timing.sample_period),
            memory_step_ns: nanoseconds(scenario.law.memory.step),
            timeout_ns: scenario.safety.command_timeout.map(nanoseconds),
            state_link: state,
            torque_link: torque,
            actuator: Actuator::new(scenario),
            next_sequence: 0,
            next_sample_ns: 0,
            handed_over: None,
            acts_from: 0,
            applied_ns: 0,
            commands: Commands::default(),
            timeouts: 0,
            has_diverged: false,
            joint_limits: scenario.safety.joint_limits.clone(),
            damping: scenario.safety.damping,
            is_within_limits: true,
            is_stopped: false,
        })
    }

    /// Takes over a changed scenario and its links, just before the sample at `time_ns`, at joint
    /// velocities `velocity`.
    pub fn reconfigure(
        &mut self,
        scenario: &Scenario,
        links: LinkChanges,
        time_ns: u64,
        velocity: &[f64; N],
    ) {
        if let Some(link) = links.state {
            self.state_link = link;
        }
        if let Some(link) = links.torque {
            self.torque_link = link;
        }
        self.actuator.reconfigure(scenario, time_ns, velocity);
        self.period_ns = nanoseconds(scenario.timing.sample_period);
        self.memory_step_ns = nanoseconds(scenario.law.memory.step);
        self.timeout_ns = scenario.safety.command_timeout.map(nanoseconds);
        self.joint_limits = scenario.safety.joint_limits.clone();
        self.damping = scenario.safety.damping;
        if self.is_stopped {
            self.actuator.brake(time_ns, self.damping);
        }
        self.time_out(time_ns, velocity);
    }

    /// Looks whether a joint has left its limits, just before the sample at `time_ns`. If one has, the
    /// arm stops; returns the joint, from 0, and the key of the limit. An arm that was released
    /// outside of its limits may go on to return.
    pub fn guard(
        &mut self,
        position: &[f64; N],
        velocity: &[f64; N],
        time_ns: u64,
    ) -> Option<(usize, &'static str)> {
        if self.joint_limits.is_empty() {
            return None;
        }
        let breach = self.joint_limits.breach(position, velocity);
        let leaves = breach.filter(|_| self.is_within_limits);
        self.is_within_limits = breach.is_none();
        if leaves.is_some() {
            self.is_stopped = true;
            self.actuator.brake(time_ns, self.damping);
        }
        leaves
    }

    /// Whether the arm is stopped.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped
    }

    /// Ends a stop: commands act again.
    pub fn release(&mut self) {
        self.is_stopped = false;
    }

    /// Takes the sample at `time_ns`; returns its number.
    #[inline(always)]
    pub fn sample(&mut self, time_ns: u64) -> u64 {
        let sequence = self.next_sequence;
        self.next_sequence += 1;
        self.next_sample_ns = time_ns + self.period_ns;
        sequence
    }

    /// Draws how long the state of this number travels, ns; `None` if it is lost. To be called once
    /// for each number, in their order.
    #[inline(always)]
    pub fn state_transit(&mut self, sequence: u64) -> Option<u64> {
        let transit_ns = self.state_link.transit_ns();
        // The two ends must meet, so the first state is not lost; it may be late.
        let kept_ns = if sequence == 0 { Some(self.state_link.latency_ns()) } else { None };
        transit_ns.or(kept_ns)
    }

    /// Hands the state of this number to the controller; false if a newer one has overtaken it.
    #[inline(always)]
    pub fn hand_over(&mut self, sequence: u64) -> bool {
        if self.handed_over >= Some(sequence) {
            return false;
        }
        self.handed_over = Some(sequence);
        self.commands.sent += 1;
        true
    }

    /// Draws what happens to the answer that sets out at `time_ns`; [`Self::count`] must follow.
    #[inline(always)]
    pub fn depart(&mut self, time_ns: u64, is_finite: bool) -> Departure {
        if !is_finite {
            return Departure::Rejected;
        }
        match self.torque_link.transit_ns() {
            Some(transit_ns) => Departure::Arrives(time_ns + transit_ns),
            None => Departure::Lost,
        }
    }

    /// Counts an answer to a state that was handed over.
    #[inline(always)]
    pub fn count(&mut self, departure: Departure) {
        match departure {
            Departure::Arrives(_) => {}
            Departure::Lost => self.commands.lost += 1,
            Departure::Rejected => self.commands.rejected += 1,
        }
    }

    /// Puts a command into effect at `time_ns` and at joint velocities `velocity`; false, and counted, if
    /// it is older than the command timeout, or if a newer one has overtaken it.
    #[inline(always)]
    pub fn apply(&mut self, command: &Command<N, E>, time_ns: u64, velocity: &[f64; N]) -> bool {
        let age_ns = time_ns.saturating_sub(command.sampled_ns);
        let is_too_old = self.timeout_ns.is_some_and(|timeout| age_ns > timeout);
        if is_too_old || self.is_stopped || command.sequence < self.acts_from {
            self.commands.too_old += 1;
            return false;
        }
        if !self.actuator.apply(command, time_ns, velocity) {
            self.commands.lost += 1;
            return false;
        }
        self.applied_ns = time_ns;
        self.commands.applied += 1;
        true
    }

    /// When the command timeout is over if no command takes effect before; `None` if it is over
    /// already, or if there is none.
    pub fn deadline(&self) -> Option<u64> {
        let timeout = self.timeout_ns.filter(|_| !self.actuator.has_timed_out())?;
        Some(self.applied_ns + timeout)
    }

    /// Ends the hold if the deadline is reached; at joint velocities `velocity`.
    pub fn time_out(&mut self, time_ns: u64, velocity: &[f64; N]) {
        if self.deadline().is_some_and(|deadline| time_ns >= deadline) {
            self.timeouts += 1;
            self.actuator.time_out(time_ns, velocity);
        }
    }

    /// Lets no command act that answers a sample taken before now.
    pub fn forget_commands(&mut self) {
        self.acts_from = self.next_sequence;
    }

    /// Checks true joint velocities, rad/s, for divergence.
    #[inline(always)]
    pub fn observe(&mut self, velocity: &[f64; N]) {
        // Written so that a NaN counts as diverged.
        self.has_diverged = !velocity.iter().all(|speed| speed.abs() < RUNAWAY);
    }

    /// Counts commands that will not come.
    pub fn lose(&mut self, commands: u64) {
        self.commands.lost += commands;
    }

    /// Counts an answer as late if its round trip took longer than a sample period.
    pub fn note_round_trip(&mut self, round_trip_ns: u64) {
        self.commands.late += u64::from(round_trip_ns > self.period_ns);
    }

    /// The mean echo over the memory step that ends at `time_ns`, a sampling instant.
    #[inline(always)]
    pub fn delivered(&mut self, time_ns: u64) -> [f64; E] {
        self.actuator.delivered(time_ns, self.memory_step_ns)
    }

    /// The actuator.
    #[inline(always)]
    pub fn actuator(&self) -> &Actuator<N, E> {
        &self.actuator
    }

    /// Whether the run has diverged.
    #[inline(always)]
    pub fn has_diverged(&self) -> bool {
        self.has_diverged
    }

    /// From one sample to the next, ns.
    #[inline(always)]
    pub fn period_ns(&self) -> u64 {
        self.period_ns
    }

    /// Number of the next sample.
    #[inline(always)]
    pub fn next_sequence(&self) -> u64 {
        self.next_sequence
    }

    /// When the next sample is taken, ns.
    #[inline(always)]
    pub fn next_sample_ns(&self) -> u64 {
        self.next_sample_ns
    }

    /// The counts so far.
    pub fn commands(&self) -> Commands {
        self.commands
    }

    /// How often commands stayed away for longer than the command timeout.
    pub fn timeouts(&self) -> u64 {
        self.timeouts
    }
}
