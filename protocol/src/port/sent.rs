//! The plant's record of the states that it sent: an answer is judged by it alone.

use crate::{
    admission::Rejection,
    sample::{StateSample, TorqueSample},
};

/// How many states are remembered; an answer to an older one does not count.
const REMEMBERED: usize = 4096;

/// The states that were sent last.
pub(super) struct SentStates {
    /// Each at its number modulo their count.
    records: Vec<Record>,
    /// The newest one; before the first, a blank one.
    pub(super) newest: StateSample,
    /// How often it was sent: a state is repeated until a controller answers it.
    pub(super) times: u64,
    /// How often it was answered.
    pub(super) answers: u64,
}

/// What the answer to a state returns.
#[derive(Clone, Copy, Default)]
struct Record {
    sequence: u64,
    time_ns: u64,
    revision: u32,
    /// When it was sent first and when last, ns.
    sent_ns: (u64, u64),
}

impl SentStates {
    /// No state was sent yet.
    pub(super) fn new() -> Self {
        Self {
            records: vec![Record::default(); REMEMBERED],
            newest: StateSample::default(),
            times: 0,
            answers: 0,
        }
    }

    /// Records that a state was sent, perhaps once more.
    pub(super) fn record(&mut self, state: &StateSample) {
        let sequence = state.header.sequence;
        let is_again = self.times > 0 && self.newest.header.sequence == sequence;
        self.newest = *state;
        let record = &mut self.records[sequence as usize % REMEMBERED];
        if is_again {
            self.times += 1;
            record.sent_ns.1 = state.sent_ns;
        } else {
            (self.times, self.answers) = (1, 0);
            *record = Record {
                sequence,
                time_ns: state.header.time_ns,
                revision: state.header.revision,
                sent_ns: (state.sent_ns, state.sent_ns),
            };
        }
    }

    /// Why an answer is not one to a state that was sent.
    pub(super) fn objection(&self, torque: &TorqueSample) -> Option<Rejection> {
        let header = &torque.header;
        let record = &self.records[header.sequence as usize % REMEMBERED];
        if self.times == 0 || record.sequence != header.sequence {
            return Some(Rejection::Unasked);
        }
        let (first, last) = record.sent_ns;
        let is_returned = header.time_ns == record.time_ns
            && header.revision == record.revision
            && (first..=last).contains(&torque.state_sent_ns);
        (!is_returned).then_some(Rejection::Echo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A state and the answer to it.
    fn pair(sequence: u64, sent_ns: u64) -> (StateSample, TorqueSample) {
        let mut state = StateSample { sent_ns, ..Default::default() };
        (state.header.sequence, state.header.time_ns) = (sequence, sequence * 10);
        let torque =
            TorqueSample { header: state.header, state_sent_ns: sent_ns, ..Default::default() };
        (state, torque)
    }

    #[test]
    fn an_answer_returns_what_was_sent_with_its_state_whichever_repetition_it_answers() {
        let mut sent = SentStates::new();
        let (first, to_first) = pair(0, 7);
        assert_eq!(sent.objection(&to_first), Some(Rejection::Unasked), "nothing was sent");
        sent.record(&first);
        let (again, to_second) = pair(0, 9);
        sent.record(&again);
        for sequence in 1..5000 {
            sent.record(&pair(sequence, sequence + 100).0);
        }
        assert_eq!(sent.objection(&pair(4999, 5099).1), None);
        assert_eq!(sent.objection(&pair(1000, 1100).1), None);
        assert_eq!(sent.objection(&to_first), Some(Rejection::Unasked), "forgotten");
        sent.record(&pair(8192, 1).0);
        assert_eq!(sent.objection(&to_second), Some(Rejection::Unasked));

        let mut sent = SentStates::new();
        sent.record(&first);
        sent.record(&again);
        assert_eq!((sent.objection(&to_first), sent.objection(&to_second)), (None, None));
        let spoilt: [fn(&mut TorqueSample); 4] = [
            |torque| torque.header.time_ns += 1,
            |torque| torque.header.revision += 1,
            |torque| torque.state_sent_ns = 6,
            |torque| torque.state_sent_ns = 10,
        ];
        for spoil in spoilt {
            let mut torque = to_first;
            spoil(&mut torque);
            assert_eq!(sent.objection(&torque), Some(Rejection::Echo), "{torque:?}");
        }
    }
}
