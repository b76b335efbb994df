//! The previous-step memory: which task force mtj adds to its next one.

use mtj_model::{
    PLANE,
    scenario::{MemoryPolicy, MemorySettings},
};
use mtj_protocol::sample::StateSample;
use nalgebra::SVector;

/// What the controller remembers, if the policy asks it to remember anything.
///
/// `applied` and `delivered` come back from the plant in every state sample, so a controller that
/// takes over in mid-run knows them at once. Only `sent` is kept here.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    policy: MemoryPolicy,
    step_ns: u64,
    latched: SVector<f64, PLANE>,
    /// When the memory step ends in which that was computed, ns; 0 if that is not known.
    step_ends_ns: u64,
    is_first: bool,
}

impl Memory {
    /// An empty memory: the first [`Memory::recall`] gives nothing, whatever the policy.
    pub fn new(settings: &MemorySettings) -> Self {
        Self {
            policy: settings.policy,
            step_ns: settings.step.as_nanos() as u64,
            latched: SVector::zeros(),
            step_ends_ns: 0,
            is_first: true,
        }
    }

    /// Forgets everything: the next [`Memory::recall`] gives nothing.
    pub fn forget(&mut self) {
        self.latched = SVector::zeros();
        self.step_ends_ns = 0;
        self.is_first = true;
    }

    /// The same memory under other settings: what was remembered stays.
    pub fn adopt(self, settings: &MemorySettings) -> Self {
        let adopted = Self { policy: settings.policy, ..self };
        let step_ns = settings.step.as_nanos() as u64;
        if step_ns == self.step_ns { adopted } else { Self { step_ns, step_ends_ns: 0, ..adopted } }
    }

    /// The remembered task force at a sample, N; `None` at the first one.
    pub fn recall(&self, state: &StateSample) -> Option<SVector<f64, PLANE>> {
        let in_plane = |force: &[f64]| SVector::from_fn(|i, _| force[i]);
        self.recall_from(|| in_plane(&state.applied), || in_plane(&state.delivered))
    }

    /// The same from what the plant has `applied` and `delivered`; only what the policy needs is asked for.
    #[inline(always)]
    pub fn recall_from(
        &self,
        applied: impl FnOnce() -> SVector<f64, PLANE>,
        delivered: impl FnOnce() -> SVector<f64, PLANE>,
    ) -> Option<SVector<f64, PLANE>> {
        (!self.is_first).then(|| match self.policy {
            MemoryPolicy::Sent => self.latched,
            MemoryPolicy::Applied => applied(),
            MemoryPolicy::Delivered => delivered(),
        })
    }

    /// Remembers the task force computed at a sample: the first one in each memory step is latched
    /// and serves until the next, so with Δt = T_s it is always the previous one.
    pub fn store(&mut self, state: &StateSample, force: &SVector<f64, PLANE>) {
        self.store_at(state.header.time_ns, force);
    }

    /// The same for a sample taken at `time_ns`.
    #[inline(always)]
    pub fn store_at(&mut self, time_ns: u64, force: &SVector<f64, PLANE>) {
        self.is_first = false;
        if time_ns >= self.step_ends_ns {
            self.step_ends_ns = (time_ns - time_ns % self.step_ns).saturating_add(self.step_ns);
            self.latched = *force;
        }
    }

    /// Remembers another task force for the step of the last sample.
    pub fn replace(&mut self, force: &SVector<f64, PLANE>) {
        self.latched = *force;
    }
}
