//! Which torque answered which state.

use std::collections::VecDeque;

use mtj_protocol::sample::{Header, StateSample, TorqueSample};

/// The most states that wait for their torque, and torques for their state. A monitor empties one
/// topic after the other, so that one may be ahead of the other by what a stream holds.
const MOST: usize = 16384;

/// Joins two streams that each keep their order, in bounded memory.
#[derive(Debug, Default)]
pub(crate) struct Pairs {
    states: VecDeque<Asked>,
    torques: VecDeque<TorqueSample>,
    runs: Vec<u64>,
    newest: Option<(u64, u64)>,
    answered: Option<(u64, u64)>,
    after_gap: bool,
    repeated: u64,
    without_state: u64,
}

/// A state and the torque that answered it.
#[derive(Debug, PartialEq)]
pub(crate) struct Pair {
    /// The state.
    pub state: StateSample,
    /// The torque that answered it.
    pub torque: TorqueSample,
    /// Whether states before this one, which the controller may have answered, are missing.
    pub after_gap: bool,
}

#[derive(Debug)]
struct Asked {
    state: StateSample,
    after_gap: bool,
}

impl Asked {
    fn place(&self) -> (u64, u64) {
        (self.state.header.run, self.state.header.sequence)
    }
}

/// Where the state of a torque is.
enum StateOf {
    /// The first of those that wait.
    First,
    /// Still to come.
    ToCome,
    /// Not in the recording.
    Missing,
}

impl Pairs {
    /// Adds a state.
    pub(crate) fn ask(&mut self, state: StateSample) {
        let (run, sequence) = (state.header.run, state.header.sequence);
        let expected = self.newest.filter(|(newest, _)| *newest == run).map_or(0, |(_, s)| s + 1);
        if !self.runs.contains(&run) {
            self.runs.push(run);
        }
        self.newest = Some((run, sequence));
        self.states.push_back(Asked { state, after_gap: sequence > expected });
        if self.states.len() > MOST {
            self.pass();
        }
    }

    /// Adds a torque.
    pub(crate) fn answer(&mut self, torque: TorqueSample) {
        self.torques.push_back(torque);
    }

    /// The next pair, in the order of the torques; `None` if more has to be added, or if the next
    /// torque is not ready.
    pub(crate) fn next(&mut self, is_ready: impl Fn(&Header) -> bool) -> Option<Pair> {
        while let Some(torque) = self.torques.front().copied() {
            if !is_ready(&torque.header) && self.torques.len() <= MOST {
                return None;
            }
            let place = (torque.header.run, torque.header.sequence);
            // Repeated for a plant that did not receive it, or from a second controller.
            if self.answered.is_some_and(|(run, newest)| run == place.0 && place.1 <= newest) {
                self.repeated += 1;
                self.torques.pop_front();
                continue;
            }
            match self.search(place) {
                StateOf::ToCome if self.torques.len() <= MOST => return None,
                StateOf::ToCome | StateOf::Missing => {
                    self.without_state += 1;
                    self.torques.pop_front();
                }
                StateOf::First => {
                    self.torques.pop_front();
                    self.answered = Some(place);
                    let Asked { state, .. } = self.pass()?;
                    let after_gap = std::mem::take(&mut self.after_gap);
                    return Some(Pair { state, torque, after_gap });
                }
            }
        }
        None
    }

    /// Drops states without an answer until the wanted one is the first.
    fn search(&mut self, (run, sequence): (u64, u64)) -> StateOf {
        while let Some(first) = self.states.front() {
            let place = first.place();
            if place == (run, sequence) {
                return StateOf::First;
            }
            let is_later = match place.0 == run {
                true => place.1 > sequence,
                false => self.states.iter().all(|asked| asked.place().0 != run),
            };
            if is_later {
                break;
            }
            self.pass();
        }
        let is_to_come = match self.newest {
            Some((newest, last)) if newest == run => last < sequence,
            _ => !self.runs.contains(&run),
        };
        if is_to_come { StateOf::ToCome } else { StateOf::Missing }
    }

    fn pass(&mut self) -> Option<Asked> {
        let first = self.states.pop_front()?;
        self.after_gap |= first.after_gap;
        Some(first)
    }

    /// Ends the recording: torques that still wait have no state.
    pub(crate) fn finish(&mut self) {
        self.without_state += self.torques.len() as u64;
        self.torques.clear();
    }

    /// Torques that answered what had been answered.
    pub(crate) fn repeated(&self) -> u64 {
        self.repeated
    }

    /// Torques whose state is not in the recording.
    pub(crate) fn without_state(&self) -> u64 {
        self.without_state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(run: u64, sequence: u64) -> Header {
        Header { run, sequence, ..Header::default() }
    }

    fn state(run: u64, sequence: u64) -> StateSample {
        StateSample { header: header(run, sequence), ..Default::default() }
    }

    fn torque(run: u64, sequence: u64) -> TorqueSample {
        TorqueSample { header: header(run, sequence), ..Default::default() }
    }

    /// The sequence numbers of the pairs, and whether each comes after a gap.
    fn drain(pairs: &mut Pairs) -> Vec<(u64, bool)> {
        std::iter::from_fn(|| pairs.next(|_| true))
            .map(|pair| {
                assert_eq!(pair.state.header, pair.torque.header);
                (pair.state.header.sequence, pair.after_gap)
            })
            .collect()
    }

    #[test]
    fn either_may_come_first_and_some_states_have_no_answer() {
        let mut pairs = Pairs::default();
        [0, 2].into_iter().for_each(|i| pairs.answer(torque(1, i)));
        assert_eq!(drain(&mut pairs), [], "their states are still to come");
        (0..4).for_each(|i| pairs.ask(state(1, i)));
        assert_eq!(drain(&mut pairs), [(0, false), (2, false)]);
        pairs.answer(torque(1, 3));
        assert_eq!(drain(&mut pairs), [(3, false)]);
    }

    #[test]
    fn a_gap_in_the_states_and_a_torque_without_state_are_counted() {
        let mut pairs = Pairs::default();
        [5, 6, 9].into_iter().for_each(|i| pairs.ask(state(1, i)));
        [4, 5, 6, 7, 9].into_iter().for_each(|i| pairs.answer(torque(1, i)));
        assert_eq!(drain(&mut pairs), [(5, true), (6, false), (9, true)]);
        assert_eq!(pairs.without_state(), 2);
    }

    #[test]
    fn answers_that_are_repeated_count_once() {
        let mut pairs = Pairs::default();
        [0, 0, 0, 1].into_iter().for_each(|i| pairs.ask(state(1, i)));
        [0, 0, 1].into_iter().for_each(|i| pairs.answer(torque(1, i)));
        assert_eq!(drain(&mut pairs), [(0, false), (1, false)]);
        assert_eq!(pairs.repeated(), 1);
    }

    #[test]
    fn one_run_may_follow_another() {
        let mut pairs = Pairs::default();
        [state(7, 0), state(7, 1), state(3, 0)].into_iter().for_each(|state| pairs.ask(state));
        [torque(7, 0), torque(3, 0), torque(7, 1), torque(4, 0)]
            .into_iter()
            .for_each(|t| pairs.answer(t));
        assert_eq!(drain(&mut pairs), [(0, false), (0, false)]);
        assert_eq!(pairs.without_state(), 1, "a straggler of the run before");
        pairs.ask(state(4, 0));
        assert_eq!(drain(&mut pairs), [(0, false)]);
    }

    #[test]
    fn a_pair_waits_until_it_is_wanted() {
        let mut pairs = Pairs::default();
        pairs.ask(state(1, 0));
        pairs.answer(torque(1, 0));
        assert_eq!(pairs.next(|_| false), None);
        assert_eq!(drain(&mut pairs), [(0, false)]);
    }

    #[test]
    fn memory_is_bounded_when_one_side_is_missing() {
        let mut pairs = Pairs::default();
        for i in 0..3 * MOST as u64 {
            pairs.answer(torque(1, i));
            assert_eq!(pairs.next(|_| true), None);
        }
        assert_eq!(pairs.torques.len(), MOST);
        for i in 0..3 * MOST as u64 {
            pairs.ask(state(2, i));
        }
        assert_eq!(pairs.states.len(), MOST);
    }
}
