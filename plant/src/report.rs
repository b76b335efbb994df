//! The measures of a run.

use mtj_model::{MAX_JOINTS, scenario::Scenario};
use serde::{Deserialize, Serialize};

use crate::{
    durations::Percentiles,
    sequencer::{Commands, Sequencer},
};

/// What `mtj run --json` prints: one object; what does not apply is null.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Name of the scenario.
    pub scenario: String,
    /// Transport.
    pub bus: String,
    /// lockstep or realtime.
    pub clock: String,
    /// tj, mtj or mb.
    pub law: String,
    /// Simulated time, s.
    pub duration_s: f64,
    /// Sampling instants.
    pub samples: u64,
    /// √mean‖e‖² of the true error over the sampling instants in the second half, m.
    pub rms_error_m: Option<f64>,
    /// max ‖e‖ over the same instants, m.
    pub peak_error_m: Option<f64>,
    /// ∫ Σ|τᵢ q̇ᵢ| dt over the whole run, J.
    pub energy_j: Option<f64>,
    /// max |τᵢ| over the whole run for each joint, N m.
    pub peak_torque_nm: Vec<f64>,
    /// rms over the commands of ‖τ_k − τ_{k−1}‖, N m.
    pub torque_step_rms_nm: Option<f64>,
    /// Whether the run diverged; it ended there.
    pub diverged: bool,
    /// Counts of the commands.
    pub commands: Commands,
    /// Sampling instants reached only after the next was due; null in lockstep.
    pub deadline_misses: Option<u64>,
    /// How often the plant did not run for a while; the run's time stood still meanwhile.
    #[serde(default)]
    pub stalls: u64,
    /// The longest of these times; null where there was none.
    #[serde(default)]
    pub longest_stall_us: Option<f64>,
    /// How often commands stayed away for longer than the command timeout.
    pub timeouts: u64,
    /// How often another controller began to lead.
    pub takeovers: u64,
    /// The longest time without a fresh command; null in lockstep.
    pub longest_gap_us: Option<f64>,
    /// State sent to torque received, by the plant's clock, without emulated latency; null where no
    /// bus is crossed.
    pub round_trip_us: Option<Percentiles>,
    /// The part spent inside the controller, by the controller's clock.
    pub residence_us: Option<Percentiles>,
}

/// Running sums from which a [`Report`] is made, for an arm of `N` joints or fewer.
#[derive(Debug)]
pub struct Measures<const N: usize = MAX_JOINTS> {
    half_ns: u64,
    samples: u64,
    squared_error: f64,
    peak_error: f64,
    counted: u64,
    peak_torque: [f64; N],
    previous: Option<[f64; N]>,
    squared_step: f64,
    steps: u64,
}

impl<const N: usize> Measures<N> {
    /// Nothing measured yet.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            half_ns: (scenario.duration.as_nanos() / 2) as u64,
            samples: 0,
            squared_error: 0.0,
            peak_error: 0.0,
            counted: 0,
            peak_torque: [0.0; N],
            previous: None,
            squared_step: 0.0,
            steps: 0,
        }
    }

    /// Adds the true tracking error of a sampling instant.
    #[inline(always)]
    pub fn sample(&mut self, time_ns: u64, squared_error: f64) {
        self.samples += 1;
        if time_ns >= self.half_ns {
            self.counted += 1;
            self.squared_error += squared_error;
            self.peak_error = self.peak_error.max(squared_error.sqrt());
        }
    }

    /// Adds a torque that came into effect.
    #[inline(always)]
    pub fn command(&mut self, torque: &[f64; N]) {
        for (peak, torque) in self.peak_torque.iter_mut().zip(torque) {
            *peak = peak.max(torque.abs());
        }
        if let Some(previous) = self.previous {
            self.steps += 1;
            self.squared_step += torque
                .iter()
                .zip(&previous)
                .map(|(now, then)| (now - then) * (now - then))
                .sum::<f64>();
        }
        self.previous = Some(*torque);
    }

    /// rms over the commands so far of ‖τ_k − τ_{k−1}‖, N m; `None` before the second.
    pub fn rms_step(&self) -> Option<f64> {
        (self.steps > 0).then(|| (self.squared_step / self.steps as f64).sqrt())
    }

    /// Sampling instants so far.
    pub fn samples(&self) -> u64 {
        self.samples
    }

    /// The measures of a run that ended at `time_ns` after so much work, J; those of wall time are
    /// null.
    pub fn report<const E: usize>(
        &self,
        scenario: &Scenario,
        sequencer: &Sequencer<N, E>,
        time_ns: u64,
        energy: f64,
    ) -> Report {
        let finite = |x: f64| x.is_finite().then_some(x);
        let over_half = |x: f64| (self.counted > 0).then_some(x).and_then(finite);
        let joints = scenario.arm.links.len();
        Report {
            scenario: scenario.name.clone(),
            bus: scenario.bus.kind.name().to_owned(),
            clock: scenario.timing.clock.name().to_owned(),
            law: scenario.law.law.description().name.to_owned(),
            duration_s: time_ns as f64 * 1e-9,
            samples: self.samples,
            rms_error_m: over_half((self.squared_error / self.counted.max(1) as f64).sqrt()),
            peak_error_m: over_half(self.peak_error),
            energy_j: finite(energy),
            peak_torque_nm: self.peak_torque[..joints].to_vec(),
            torque_step_rms_nm: self.rms_step().and_then(finite),
            diverged: sequencer.has_diverged(),
            commands: sequencer.commands(),
            deadline_misses: None,
            stalls: 0,
            longest_stall_us: None,
            timeouts: sequencer.timeouts(),
            takeovers: 0,
            longest_gap_us: None,
            round_trip_us: None,
            residence_us: None,
        }
    }
}
