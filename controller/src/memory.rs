//! The previous-step memory: which echo a law gets back.

use mtj_model::{
    MAX_ECHO,
    scenario::{MemoryPolicy, MemorySettings},
};

/// The echo that a law gets back.
///
/// `applied` and `delivered` come back from the plant in every state sample, so a controller that
/// takes over in mid-run knows them at once. Only `sent` is kept here.
#[derive(Clone, Copy, Debug)]
pub struct Memory<const E: usize = MAX_ECHO> {
    policy: MemoryPolicy,
    step_ns: u64,
    latched: [f64; E],
    /// When the memory step of `latched` ends, ns; 0 if that is not known.
    step_ends_ns: u64,
    is_first: bool,
}

impl<const E: usize> Memory<E> {
    /// An empty memory: the first [`Memory::recall`] gives nothing, whatever the policy.
    pub fn new(settings: &MemorySettings) -> Self {
        Self {
            policy: settings.policy,
            step_ns: settings.step.as_nanos() as u64,
            latched: [0.0; E],
            step_ends_ns: 0,
            is_first: true,
        }
    }

    /// Empties the memory: the next [`Memory::recall`] gives nothing.
    pub fn forget(&mut self) {
        self.latched = [0.0; E];
        self.step_ends_ns = 0;
        self.is_first = true;
    }

    /// The same memory under other settings: its echo stays.
    pub fn reconfigure(self, settings: &MemorySettings) -> Self {
        let changed = Self { policy: settings.policy, ..self };
        let step_ns = settings.step.as_nanos() as u64;
        if step_ns == self.step_ns { changed } else { Self { step_ns, step_ends_ns: 0, ..changed } }
    }

    /// The echo for a sample, from what the plant has `applied` and `delivered`; `None` at the
    /// first sample.
    #[inline(always)]
    pub fn recall<'a>(
        &'a self,
        applied: &'a [f64; E],
        delivered: &'a [f64; E],
    ) -> Option<&'a [f64; E]> {
        (!self.is_first).then_some(match self.policy {
            MemoryPolicy::Sent => &self.latched,
            MemoryPolicy::Applied => applied,
            MemoryPolicy::Delivered => delivered,
        })
    }

    /// Stores the echo computed at a sample taken at `time_ns`. The first one in each memory step
    /// is latched and serves until the next step, so with Δt = T_s it is always the previous one.
    #[inline(always)]
    pub fn store(&mut self, time_ns: u64, echo: &[f64; E]) {
        self.is_first = false;
        if time_ns >= self.step_ends_ns {
            // Divides only after skipped steps: a division takes longer than the rest of this
            // function.
            let next_ns = self.step_ends_ns.saturating_add(self.step_ns);
            self.step_ends_ns = if time_ns < next_ns {
                next_ns
            } else {
                (time_ns - time_ns % self.step_ns).saturating_add(self.step_ns)
            };
            self.latched = *echo;
        }
    }

    /// Replaces the echo of the last sample's memory step.
    pub fn replace(&mut self, echo: &[f64; E]) {
        self.latched = *echo;
    }
}
