//! By what a step is measured.

/// What measures a step. Generic over the step, so that no call through a pointer stands between
/// the two.
pub trait Meter {
    /// Calls `step` as often as it needs to.
    fn measure(&mut self, step: impl FnMut());
}
