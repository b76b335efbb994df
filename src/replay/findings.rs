//! How the answers of a replay compare with the recorded ones.

use std::fmt;

use mtj_protocol::sample::{Header, TorqueSample};
use serde::Serialize;

/// How the answers of a replay compare with the recorded ones.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Findings {
    /// States in the recording.
    pub states: u64,
    /// Torques in the recording.
    pub torques: u64,
    /// Torques that were compared with an answer of the replay.
    pub compared: u64,
    /// Those that were not the same to the last bit.
    pub differing: u64,
    /// The first of them.
    pub first: Option<Difference>,
    /// The largest |Δτ| on each joint.
    pub largest: Vec<Largest>,
    /// How often another controller took over.
    pub takeovers: u64,
    /// Torques used to learn what the recorded controller remembered where a recording begins in
    /// mid-run, has a gap, or another controller takes over.
    pub joined: u64,
    /// Torques for states that had been answered before.
    pub repeated: u64,
    /// Torques whose state is not in the recording.
    pub without_state: u64,
    /// Torques whose scenario is not in the recording.
    pub without_scenario: u64,
    /// Whether the recording was cut short.
    pub cut_short: bool,
}

/// One sampling instant of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Instant {
    /// Which run.
    pub run: u64,
    /// Which sample of it.
    pub sequence: u64,
    /// When, since the run began.
    pub time_s: f64,
}

/// A torque that is not the recorded one.
#[derive(Debug, Serialize)]
pub(crate) struct Difference {
    /// Of which sample.
    pub at: Instant,
    /// N m.
    pub recorded_nm: Vec<f64>,
    /// N m.
    pub replayed_nm: Vec<f64>,
}

/// The largest difference on a joint.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Largest {
    /// |Δτ|, N m.
    pub difference_nm: f64,
    /// Where.
    pub at: Instant,
}

impl Instant {
    /// The sampling instant of a sample.
    pub(crate) fn of(header: &Header) -> Self {
        let Header { run, sequence, time_ns, .. } = *header;
        Self { run, sequence, time_s: time_ns as f64 / 1e9 }
    }
}

impl fmt::Display for Instant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "t = {:.6} s (sample {} of run {})", self.time_s, self.sequence, self.run)
    }
}

impl Findings {
    pub(super) fn compare(&mut self, recorded: &TorqueSample, answer: &TorqueSample, same: bool) {
        self.compared += 1;
        if same {
            return;
        }
        self.differing += 1;
        let at = Instant::of(&recorded.header);
        let joints = recorded.header.joints as usize;
        let (recorded, answer) = (&recorded.torque[..joints], &answer.torque[..joints]);
        self.first.get_or_insert_with(|| Difference {
            at,
            recorded_nm: recorded.to_vec(),
            replayed_nm: answer.to_vec(),
        });
        for (joint, (recorded, answer)) in recorded.iter().zip(answer).enumerate() {
            let difference_nm = (recorded - answer).abs();
            match self.largest.get_mut(joint) {
                None => self.largest.push(Largest { difference_nm, at }),
                Some(largest) if difference_nm > largest.difference_nm => {
                    *largest = Largest { difference_nm, at };
                }
                Some(_) => {}
            }
        }
    }
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { states, torques, compared, differing, .. } = self;
        writeln!(
            f,
            "{states} states, {torques} torques: {compared} compared, {differing} differing"
        )?;
        if let Some(first) = &self.first {
            writeln!(
                f,
                "first at {}: recorded {:?} N m, replayed {:?} N m",
                first.at, first.recorded_nm, first.replayed_nm
            )?;
        }
        for (joint, largest) in self.largest.iter().enumerate() {
            let Largest { difference_nm, at } = largest;
            writeln!(f, "joint {}: |Δτ| up to {difference_nm:.3e} N m, at {at}", joint + 1)?;
        }
        for (count, what) in [
            (self.takeovers, "another controller took over"),
            (self.joined, "not compared: the recording has nothing right before them"),
            (self.repeated, "not compared: answers to states that had been answered before"),
            (self.without_state, "not compared: their state is not in the recording"),
            (self.without_scenario, "not compared: their scenario is not in the recording"),
        ] {
            if count > 0 {
                writeln!(f, "{count} × {what}")?;
            }
        }
        if self.cut_short {
            writeln!(f, "the recording was cut short; this is all up to there")?;
        }
        Ok(())
    }
}
