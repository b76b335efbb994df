//! What holds whatever happened.

use std::{collections::BTreeMap, fs};

use mtj_protocol::sample::{Phase, StatusSample};
use nix::sys::signal::Signal;
use serde_json::Value;

use super::episode::{Episode, Heard, RATE};
use crate::session::{Session, holdings::Holdings, shared_memory_of};

/// The longest latency that an episode sets, and what travels in it at the shortest period.
const UNDER_WAY: u64 = 30;
/// The longest sample period that an episode sets, s.
const PERIOD: f64 = 0.01;
/// How fast the desired point goes at most, on the circle and on the way to another, m/s.
const FASTEST: f64 = 12.0;

impl Episode {
    /// Ends the episode, and holds it against the promises.
    pub fn end(mut self) {
        if self.plant.has_ended() {
            let status = self.plant.wait();
            panic!("the plant ended, {status}: {}", self.plant.stderr());
        }
        self.ask("resume");
        self.wait(300);
        Holdings::of(self.plant.id()).assert_not_above(self.held);
        self.plant.signal(Signal::SIGINT);
        let status = self.plant.wait();
        assert!(status.success(), "{status}: {}", self.plant.stderr());
        let report: Value = serde_json::from_str(&self.plant.stdout()).unwrap();
        assert_eq!(report["diverged"], false, "{report}");
        self.assert_counts_add_up(&report);
        let rows = self.trace();
        self.assert_torques_keep_their_limits(&rows);
        self.assert_torques_keep_their_rate(&rows);
        assert_desired_point_does_not_jump(&rows);
        self.assert_safe_in_time();
        let pids = self.pids.clone();
        self.close();
        // The next process to come cleans up after those that were killed.
        let next = Session::on("iceoryx2");
        let mut cleaning = next.start("run --json --set duration=0.1s");
        assert!(cleaning.wait().success(), "{}", cleaning.stderr());
        let left = shared_memory_of(&pids);
        assert!(left.is_empty(), "left behind: {left:?}");
    }

    fn assert_counts_add_up(&self, report: &Value) {
        let count = |name: &str| report["commands"][name].as_u64().unwrap();
        let known = count("applied") + count("lost") + count("too_old");
        assert!(known <= count("sent"), "{report}");
        assert!(count("sent") - known <= UNDER_WAY, "commands nobody knows of: {report}");
    }

    fn trace(&self) -> Vec<Row> {
        let trace = fs::read_to_string(self.session.directory.join("trace.csv")).unwrap();
        let mut lines = trace.lines();
        let titles: Vec<&str> = lines.next().unwrap().split(',').collect();
        let column = |title: &str| titles.iter().position(|found| *found == title).unwrap();
        let [time, torques, desired] =
            [&["time_s"][..], &["torque_nm_1", "torque_nm_2"], &["x_desired_m", "y_desired_m"]]
                .map(|titles| titles.iter().map(|title| column(title)).collect::<Vec<_>>());
        lines
            .map(|line| {
                let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
                assert!(cells.iter().all(|cell| cell.is_finite()), "{line}");
                Row {
                    time: cells[time[0]],
                    torque: [cells[torques[0]], cells[torques[1]]],
                    desired: [cells[desired[0]], cells[desired[1]]],
                }
            })
            .collect()
    }

    fn assert_torques_keep_their_limits(&self, rows: &[Row]) {
        for (sample, row) in (0..).zip(rows) {
            let limit = *self.limits.range(..=sample).next_back().unwrap().1;
            let largest = row.torque.iter().map(|torque| torque.abs()).fold(0.0, f64::max);
            assert!(largest <= limit, "sample {sample}: {largest} N m beyond {limit} N m");
        }
    }

    /// From sample to sample a torque changes by no more than its rate allows, but where the arm goes
    /// into its safe state or a limit was changed.
    fn assert_torques_keep_their_rate(&self, rows: &[Row]) {
        let is_safe: BTreeMap<u64, bool> = self
            .heard
            .states
            .iter()
            .map(|state| (state.header.sequence, state.timed_out == 1))
            .collect();
        for (sample, pair) in (1..).zip(rows.windows(2)) {
            let commanded = [sample - 1, sample]
                .iter()
                .all(|sample| is_safe.get(sample).is_some_and(|is_safe| !is_safe));
            let limits_changed = self.limits.contains_key(&sample);
            if !commanded || limits_changed || self.may_have_timed_out(sample) {
                continue;
            }
            // The first command of an interval may use time from before it, a sample period at most.
            let most = RATE * (pair[1].time - pair[0].time + PERIOD);
            for joint in 0..2 {
                let step = (pair[1].torque[joint] - pair[0].torque[joint]).abs();
                assert!(step <= most + 1e-9, "sample {sample}: {step} N m in one period");
            }
        }
    }

    /// Whether the arm may have been in its safe state for a part of the period before this sample:
    /// whether a timeout was counted between the statuses around it.
    fn may_have_timed_out(&self, sample: u64) -> bool {
        let statuses = &self.heard.statuses;
        let next = statuses.partition_point(|status| status.header.sequence < sample);
        let before = next.checked_sub(1).map(|before| statuses[before].timeouts);
        before.is_none() || before != statuses.get(next).map(|status| status.timeouts)
    }

    /// Where no command took effect for longer than the timeout, the arm is in its safe state; and no
    /// command that took effect was older.
    fn assert_safe_in_time(&self) {
        let Heard { states, statuses } = &self.heard;
        let timeout_at = |sequence: u64| *self.timeouts.range(..=sequence).next_back().unwrap().1;
        // A timeout that was longer before may have let an older command act just before it changed.
        let longest = |sequence: u64| {
            let before = self.timeouts.range(..=sequence).rev().take(2);
            before.map(|(_, timeout)| *timeout).max().unwrap()
        };
        for state in states.iter().filter(|state| state.header.sequence > 0) {
            let limit = longest(state.header.sequence);
            assert!(state.latency_ns <= limit, "{} ns old: {:?}", state.latency_ns, state.header);
        }
        let mut last_applied: Option<StatusSample> = None;
        for status in statuses.iter().filter(|status| status.phase() == Some(Phase::Running)) {
            let since = match &last_applied {
                Some(last) if last.applied == status.applied => last,
                _ => {
                    last_applied = Some(*status);
                    continue;
                }
            };
            // Applied just before the status that first told of it; told of at the next sample.
            let silent_ns = status.header.time_ns - since.header.time_ns;
            let timeout = timeout_at(status.header.sequence);
            if silent_ns > timeout + 30_000_000 {
                let state =
                    states.iter().find(|state| state.header.sequence == status.header.sequence);
                let is_safe = state.is_none_or(|state| state.timed_out == 1);
                assert!(is_safe, "{silent_ns} ns without a command: {:?}", status.header);
            }
        }
    }
}

/// A line of the trace.
struct Row {
    time: f64,
    torque: [f64; 2],
    desired: [f64; 2],
}

fn assert_desired_point_does_not_jump(rows: &[Row]) {
    for pair in rows.windows(2) {
        let [from, to] = [0, 1].map(|i| pair[i].desired);
        let way = (to[0] - from[0]).hypot(to[1] - from[1]);
        let time = pair[1].time - pair[0].time;
        assert!(way <= FASTEST * time, "the desired point went {way} m in {time} s");
    }
}
