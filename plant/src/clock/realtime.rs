//! Real time: events are due at instants of the monotonic clock, and answers come when they come.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

use mtj_protocol::{bus::BusError, port::Answer, sample::StateSample, stall};

use super::{Clock, Heard, Stalls};
use crate::{peer::Peer, sequencer::Sequencer};

/// How often to look whether to go on.
const PATIENCE: Duration = Duration::from_millis(100);
/// How many unanswered states are remembered; older ones count as lost.
const OUTSTANDING: usize = 4096;

/// Wall time: the run's time is mapped to absolute instants, so that no error adds up over a run.
pub(crate) struct Realtime {
    origin: Instant,
    /// When this process certainly ran.
    seen: Instant,
    stalls: Stalls,
    /// Handed over and not answered yet: sequence number, and when it was sent by the peer's clock.
    unanswered: VecDeque<(u64, u64)>,
    deadline_misses: u64,
    applied_ns: u64,
    longest_gap_ns: u64,
}

impl Realtime {
    fn now_ns(&self) -> u64 {
        self.origin.elapsed().as_nanos() as u64
    }

    /// Notes that it is `now` though at `expected` this process should have run: time that it did
    /// not have is no time of the run, and commands from before it do not act.
    fn notice(
        &mut self,
        now: Instant,
        expected: Instant,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
    ) {
        self.seen = now;
        // A sample that is a little late is taken late.
        let ignored = 2 * Duration::from_nanos(sequencer.period_ns());
        let Some(stall) = stall::stall(expected, now).filter(|stall| *stall > ignored) else {
            return;
        };
        self.origin += stall;
        self.stalls.count += 1;
        self.stalls.longest_ns = self.stalls.longest_ns.max(stall.as_nanos() as u64);
        peer.forget_round_trips();
        sequencer.forget_commands();
        stall::tell("the plant", stall, "the run stood still meanwhile");
    }

    /// Counts the torque that was received `now`, and the states before the one that it answers.
    fn count_answer(&mut self, now: Instant, peer: &mut Peer<'_>, sequencer: &mut Sequencer) {
        if let Some(round_trip_ns) = peer.note_round_trip(now) {
            sequencer.note_round_trip(round_trip_ns);
        }
        let answered = peer.torque().header.sequence;
        while let Some((sequence, _)) = self.unanswered.front().copied()
            && sequence <= answered
        {
            self.unanswered.pop_front();
            sequencer.lose(u64::from(sequence < answered));
        }
    }
}

impl Clock for Realtime {
    fn new() -> Self {
        wake_punctually();
        Self {
            origin: Instant::now(),
            seen: Instant::now(),
            stalls: Stalls::default(),
            unanswered: VecDeque::with_capacity(OUTSTANDING + 1),
            deadline_misses: 0,
            applied_ns: 0,
            longest_gap_ns: 0,
        }
    }

    fn start(&mut self) {
        self.origin = Instant::now();
        self.seen = self.origin;
    }

    /// Listens for torques.
    fn wait(
        &mut self,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
        time_ns: u64,
    ) -> Result<Heard, BusError> {
        loop {
            let now = Instant::now();
            self.notice(now, self.seen, peer, sequencer);
            let patience = (self.origin + Duration::from_nanos(time_ns)).min(now + PATIENCE);
            let received = peer.exchange().receive(patience)?;
            let now = Instant::now();
            self.notice(now, patience, peer, sequencer);
            if received == Some(Answer::Torque) {
                self.count_answer(now, peer, sequencer);
                return Ok(Heard::Torque((now - self.origin).as_nanos() as u64));
            }
            if !peer.may_proceed() {
                return Ok(Heard::Stop);
            }
            if now >= self.origin + Duration::from_nanos(time_ns) {
                return Ok(Heard::Nothing);
            }
        }
    }

    /// Sends the state; its answer comes while the clock waits.
    fn hand_over(
        &mut self,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
        state: &mut StateSample,
        _time_ns: u64,
    ) -> Result<Heard, BusError> {
        if self.unanswered.len() == OUTSTANDING {
            self.unanswered.pop_front();
            sequencer.lose(1);
        }
        peer.send(state)?;
        self.unanswered.push_back((state.header.sequence, state.sent_ns));
        Ok(Heard::Nothing)
    }

    fn stands_still(&self) -> bool {
        false
    }

    fn stand_still(
        &mut self,
        peer: &mut Peer<'_>,
        sequencer: &mut Sequencer,
        time_ns: u64,
        patience: Duration,
    ) -> Result<Heard, BusError> {
        // What is under way to the plant was asked for before.
        if peer.exchange().receive(Instant::now() + patience)? != Some(Answer::Torque) {
            return Ok(Heard::Nothing);
        }
        self.count_answer(Instant::now(), peer, sequencer);
        Ok(Heard::Torque(time_ns))
    }

    fn resume(&mut self, stood_still: Duration) {
        self.origin += stood_still;
        self.seen = Instant::now();
    }

    fn sample(&mut self, time_ns: u64, period_ns: u64) {
        self.deadline_misses += u64::from(self.now_ns() > time_ns + period_ns);
    }

    fn apply(&mut self, time_ns: u64) {
        self.longest_gap_ns = self.longest_gap_ns.max(time_ns.saturating_sub(self.applied_ns));
        self.applied_ns = time_ns;
    }

    /// What was asked for more than a sample period ago and has not come, will not come.
    fn end(&mut self, peer: &Peer<'_>, sequencer: &mut Sequencer, time_ns: u64) {
        self.apply(time_ns);
        let earliest = peer.now_ns().saturating_sub(sequencer.period_ns());
        let lost = self.unanswered.iter().filter(|(_, sent_ns)| *sent_ns < earliest).count();
        sequencer.lose(lost as u64);
    }

    fn deadline_misses(&self) -> Option<u64> {
        Some(self.deadline_misses)
    }

    fn stalls(&self) -> Stalls {
        self.stalls
    }

    fn longest_gap_ns(&self) -> Option<u64> {
        Some(self.longest_gap_ns)
    }
}

/// Asks the kernel to wake this thread when a deadline is due, not up to 50 µs later, as it may
/// otherwise to save power: at a sampling instant that would be latency.
fn wake_punctually() {
    #[cfg(target_os = "linux")]
    {
        // Where it is refused, waking is a little less punctual; the round trips show it.
        let _ = nix::sys::prctl::set_timerslack(1);
    }
}
