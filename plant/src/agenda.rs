//! The plant's queue of events, ordered by time.

use std::{cmp::Ordering, collections::BinaryHeap};

use mtj_protocol::sample::StateSample;

use crate::actuator::Command;

/// An event of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A command leaves the torque link and takes effect.
    Arrive(Command),
    /// The tip takes up a load of this mass, kg, in place of the one before.
    Load(f64),
    /// The command timeout may be over.
    Timeout,
    /// The disturbance with this number ends.
    EndDisturbance(u64),
    /// A state leaves the state link and goes to the controller.
    Deliver(StateSample),
    /// The state is measured.
    Sample,
}

impl Event {
    /// Order at the same instant: commands come before the samples that are to see them, so that a
    /// latency of a whole period means the same in either direction.
    fn rank(&self) -> u8 {
        match self {
            Self::Arrive(_) => 0,
            Self::Load(_) => 1,
            Self::Timeout => 2,
            Self::EndDisturbance(_) => 3,
            Self::Deliver(_) => 4,
            Self::Sample => 5,
        }
    }

    /// Whether the event reads or moves the arm. A message that merely travels must not divide an
    /// integration step: a latency gives the same trajectory, bit for bit, in either direction.
    pub fn concerns_the_arm(&self) -> bool {
        !matches!(self, Self::Deliver(_))
    }
}

/// Future events; [`Agenda::pop`] gives the earliest, then the lowest rank, then the oldest entry.
#[derive(Debug)]
pub struct Agenda {
    heap: BinaryHeap<Entry>,
    entries: u64,
}

#[derive(Debug)]
struct Entry {
    time_ns: u64,
    rank: u8,
    number: u64,
    event: Event,
}

impl Agenda {
    /// An empty agenda with room for all events that can be pending at once.
    pub fn new() -> Self {
        Self { heap: BinaryHeap::with_capacity(1024), entries: 0 }
    }

    /// Adds an event at `time_ns`, ns since the run began.
    pub fn push(&mut self, time_ns: u64, event: Event) {
        let entry = Entry { time_ns, rank: event.rank(), number: self.entries, event };
        self.entries += 1;
        self.heap.push(entry);
    }

    /// When the next event is.
    pub fn next_time(&self) -> Option<u64> {
        self.heap.peek().map(|entry| entry.time_ns)
    }

    /// Takes the next event.
    pub fn pop(&mut self) -> Option<(u64, Event)> {
        self.heap.pop().map(|entry| (entry.time_ns, entry.event))
    }
}

impl Default for Agenda {
    fn default() -> Self {
        Self::new()
    }
}

impl Entry {
    fn key(&self) -> (u64, u8, u64) {
        (self.time_ns, self.rank, self.number)
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    /// Reversed: the heap gives its greatest entry first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.key().cmp(&self.key())
    }
}

#[cfg(test)]
mod tests {
    use mtj_protocol::sample::TorqueSample;

    use super::*;

    #[test]
    fn events_come_by_time_then_rank_then_age() {
        let command = Command::of(&TorqueSample::default(), [0.0; _]);
        let mut agenda = Agenda::new();
        agenda.push(5, Event::Sample);
        agenda.push(5, Event::EndDisturbance(1));
        agenda.push(5, Event::EndDisturbance(2));
        agenda.push(5, Event::Timeout);
        agenda.push(5, Event::Arrive(command));
        agenda.push(3, Event::Sample);
        let order: Vec<_> = std::iter::from_fn(|| agenda.pop()).collect();
        assert_eq!(
            order,
            [
                (3, Event::Sample),
                (5, Event::Arrive(command)),
                (5, Event::Timeout),
                (5, Event::EndDisturbance(1)),
                (5, Event::EndDisturbance(2)),
                (5, Event::Sample),
            ]
        );
    }
}
