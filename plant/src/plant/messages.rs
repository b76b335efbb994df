//! What a plant tells its user on the way.

use mtj_model::scenario::OnTimeout;
use mtj_protocol::sample::Joints;

use super::Plant;
use crate::clock::Clock;

/// A step of the torque up to this size is not worth a word, N m.
const SOFT_STEP: f64 = 5.0;

impl<C: Clock> Plant<'_, C> {
    /// Tells the user of the first timeout.
    pub(super) fn tell_timeout(&mut self, time_ns: u64) {
        if self.sequencer.timeouts() > 0 && !std::mem::replace(&mut self.is_timeout_told, true) {
            let does = match self.scenario.safety.on_timeout {
                OnTimeout::Hold => "the last torque is held",
                OnTimeout::Zero => "the arm has no torque",
                OnTimeout::Damp(_) => "the arm brakes",
            };
            tracing::warn!(
                "t = {:.3} s: no command has taken effect within safety.command_timeout, {does} (said \
                 once, counted always)",
                time_ns as f64 * 1e-9
            );
        }
    }

    /// Tells the user of a change of law that made the torque jump.
    pub(super) fn tell_step(&self, before: &Joints, torque: &Joints) {
        let steps = before.iter().zip(torque).map(|(before, torque)| (torque - before).abs());
        let (joint, step) = steps
            .enumerate()
            .fold((0, 0.0), |most, (joint, step)| if step > most.1 { (joint, step) } else { most });
        if step > SOFT_STEP && step > 10.0 * self.measures.rms_step().unwrap_or(0.0) {
            tracing::warn!(
                "the change of law made the torque at joint {} step by {step:.1} N m; \
                 safety.torque_rate_limit makes such a change soft",
                joint + 1
            );
        }
    }
}

/// Tells the user of a joint, from 0, that left its limits.
pub(super) fn tell_stop(time_ns: u64, joint: usize, key: &str) {
    tracing::warn!(
        "t = {:.3} s: joint {} is beyond {key}: the arm brakes, and no command acts, until \
         'mtj resume' or 'mtj reset'",
        time_ns as f64 * 1e-9,
        joint + 1
    );
}
