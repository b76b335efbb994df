//! The wall-clock time of a message.

use mtj_protocol::{
    port::Message,
    sample::{Header, StatusSample},
};

use super::topic::header;

/// Converts the time of runs to wall-clock time: log time = start of the run + the run's time.
///
/// The start follows from the first sample of the run: the time at which it came, minus the run's
/// time. Later samples do not change it, so that delays of the bus do not show in the log times.
#[derive(Debug, Default)]
pub struct Timeline {
    run: Option<u64>,
    start_ns: u64,
    /// The sequence number of the newest state.
    sequence: u64,
    /// The run's time stands still, waiting for a controller or paused; meanwhile its start moves.
    is_stopped: bool,
}

impl Timeline {
    /// The log time of a message that comes at `now_ns`, both in ns since 1970.
    pub fn log_time(&mut self, message: &Message, now_ns: u64) -> u64 {
        match message {
            Message::State(state) => {
                self.follow(&state.header, now_ns);
                self.sequence = state.header.sequence;
                self.is_stopped = self.sequence == 0;
            }
            Message::Status(StatusSample { header, phase, .. }) => {
                self.follow(header, now_ns);
                // Topics are read one after the other: a newer state may have come before.
                let is_newest = header.sequence >= self.sequence;
                self.is_stopped |= is_newest && matches!(phase, 0 | 3);
            }
            _ => {}
        }
        match header(message) {
            // Requests, and messages of other runs, have no time within this run.
            Some(header) if self.run == Some(header.run) && !is_request(message) => {
                self.start_ns.saturating_add(header.time_ns)
            }
            _ => now_ns,
        }
    }

    fn follow(&mut self, header: &Header, now_ns: u64) {
        if self.is_stopped || self.run != Some(header.run) {
            if self.run.replace(header.run) != Some(header.run) {
                self.sequence = 0;
            }
            self.start_ns = now_ns.saturating_sub(header.time_ns);
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
    fn late_samples_keep_the_distance_of_their_sampling_instants() {
        let mut timeline = Timeline::default();
        assert_eq!(timeline.log_time(&state(1, 500, 5000), DAY), DAY, "joined in mid-run");
        assert_eq!(timeline.log_time(&state(1, 501, 5010), DAY + 4321), DAY + 10);
        assert_eq!(timeline.log_time(&status(1, 1, 5010), DAY + 4322), DAY + 10);
        assert_eq!(timeline.log_time(&state(2, 7, 70), DAY + 9000), DAY + 9000, "another run");
    }

    #[test]
    fn an_old_status_does_not_stop_a_run_that_goes_on() {
        let mut timeline = Timeline::default();
        for (phase, first) in [(0, 0), (3, 50)] {
            timeline.log_time(&state(1, first, 10 * first), DAY);
            timeline.log_time(&status(1, phase, 10 * first), DAY + 500);
            let begun = timeline.log_time(&state(1, first + 1, 10 * first + 10), DAY + 900);
            timeline.log_time(&status(1, phase, 10 * first), DAY + 901);
            let next = timeline.log_time(&state(1, first + 2, 10 * first + 20), DAY + 950);
            assert_eq!((begun, next), (DAY + 900, DAY + 910), "phase {phase}");
        }
    }

    #[test]
    fn a_stopped_run_delays_its_later_samples() {
        let mut timeline = Timeline::default();
        timeline.log_time(&state(1, 0, 0), DAY);
        assert_eq!(timeline.log_time(&state(1, 0, 0), DAY + 900), DAY + 900, "still no controller");
        assert_eq!(timeline.log_time(&state(1, 1, 10), DAY + 910), DAY + 910);
        assert_eq!(timeline.log_time(&status(1, 3, 10), DAY + 920), DAY + 10 + 900, "paused");
        assert_eq!(timeline.log_time(&status(1, 3, 10), DAY + 5920), DAY + 5920);
        assert_eq!(timeline.log_time(&state(1, 2, 20), DAY + 6000), DAY + 6000);
        assert_eq!(timeline.log_time(&state(1, 3, 30), DAY + 6500), DAY + 6010);
    }

    #[test]
    fn a_request_has_the_time_at_which_it_comes() {
        let mut timeline = Timeline::default();
        timeline.log_time(&state(1, 9, 90), DAY);
        let request = RequestSample { header: header(1, DAY, 0), ..Default::default() };
        assert_eq!(timeline.log_time(&Message::Request(request), DAY + 77), DAY + 77);
    }
}
