//! When a message was, by the wall clock.

use mtj_protocol::{
    port::Message,
    sample::{Header, StatusSample},
};

use super::topic::header;

/// Lays the time of runs on the wall clock: a run began at the time of day at which its first sample
/// was heard, less the run's time by then. From there on the run's own time counts, which knows
/// nothing of how late a sample was heard.
#[derive(Default)]
pub struct Timeline {
    run: Option<u64>,
    began_ns: u64,
    /// Of the newest state.
    sequence: u64,
    /// The run's time stands still, waiting for a controller or paused: its beginning moves on.
    stands: bool,
}

impl Timeline {
    /// When the message was, ns since 1970, if it is `now_ns`.
    pub fn place(&mut self, message: &Message, now_ns: u64) -> u64 {
        match message {
            Message::State(state) => {
                self.follow(&state.header, now_ns);
                self.sequence = state.header.sequence;
                self.stands = self.sequence == 0;
            }
            Message::Status(StatusSample { header, phase, .. }) => {
                self.follow(header, now_ns);
                // Topics are heard one after the other: time may have gone on since.
                let is_newest = header.sequence >= self.sequence;
                self.stands |= is_newest && matches!(phase, 0 | 3);
            }
            _ => {}
        }
        match header(message) {
            // What is wished for has no place in the run, nor what belongs to another run.
            Some(header) if self.run == Some(header.run) && !is_request(message) => {
                self.began_ns.saturating_add(header.time_ns)
            }
            _ => now_ns,
        }
    }

    fn follow(&mut self, header: &Header, now_ns: u64) {
        if self.stands || self.run != Some(header.run) {
            if self.run.replace(header.run) != Some(header.run) {
                self.sequence = 0;
            }
            self.began_ns = now_ns.saturating_sub(header.time_ns);
        }
    }
}

fn is_request(message: &Message) -> bool {
    matches!(message, Message::Request(_))
}

#[cfg(test)]
mod tests {
    use mtj_protocol::sample::{RequestSample, StateSample};

    use super::*;

    const DAY: u64 = 1_700_000_000_000_000_000;

    fn header(run: u64, sequence: u64, time_ns: u64) -> Header {
        Header { run, sequence, time_ns, ..Header::default() }
    }

    fn state(run: u64, sequence: u64, time_ns: u64) -> Message {
        Message::State(StateSample { header: header(run, sequence, time_ns), ..Default::default() })
    }

    fn status(run: u64, phase: u64, time_ns: u64) -> Message {
        let header = header(run, time_ns / 10, time_ns);
        Message::Status(StatusSample { header, phase, ..Default::default() })
    }

    #[test]
    fn samples_are_as_far_apart_as_their_instants_however_late_they_are_heard() {
        let mut timeline = Timeline::default();
        assert_eq!(timeline.place(&state(1, 500, 5000), DAY), DAY, "joined in mid-run");
        assert_eq!(timeline.place(&state(1, 501, 5010), DAY + 4321), DAY + 10);
        assert_eq!(timeline.place(&status(1, 1, 5010), DAY + 4322), DAY + 10);
        assert_eq!(timeline.place(&state(2, 7, 70), DAY + 9000), DAY + 9000, "another run");
    }

    #[test]
    fn a_status_from_before_the_run_went_on_stops_no_clock() {
        let mut timeline = Timeline::default();
        for (phase, first) in [(0, 0), (3, 50)] {
            timeline.place(&state(1, first, 10 * first), DAY);
            timeline.place(&status(1, phase, 10 * first), DAY + 500);
            let begun = timeline.place(&state(1, first + 1, 10 * first + 10), DAY + 900);
            timeline.place(&status(1, phase, 10 * first), DAY + 901);
            let next = timeline.place(&state(1, first + 2, 10 * first + 20), DAY + 950);
            assert_eq!((begun, next), (DAY + 900, DAY + 910), "phase {phase}");
        }
    }

    #[test]
    fn time_that_stands_still_is_not_lost() {
        let mut timeline = Timeline::default();
        timeline.place(&state(1, 0, 0), DAY);
        assert_eq!(timeline.place(&state(1, 0, 0), DAY + 900), DAY + 900, "still no controller");
        assert_eq!(timeline.place(&state(1, 1, 10), DAY + 910), DAY + 910);
        assert_eq!(timeline.place(&status(1, 3, 10), DAY + 920), DAY + 10 + 900, "paused");
        assert_eq!(timeline.place(&status(1, 3, 10), DAY + 5920), DAY + 5920);
        assert_eq!(timeline.place(&state(1, 2, 20), DAY + 6000), DAY + 6000);
        assert_eq!(timeline.place(&state(1, 3, 30), DAY + 6500), DAY + 6010);
    }

    #[test]
    fn a_request_is_when_it_is_heard() {
        let mut timeline = Timeline::default();
        timeline.place(&state(1, 9, 90), DAY);
        let request = RequestSample { header: header(1, DAY, 0), ..Default::default() };
        assert_eq!(timeline.place(&Message::Request(request), DAY + 77), DAY + 77);
    }
}
