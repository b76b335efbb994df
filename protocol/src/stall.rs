//! Time that a process did not have: it was stopped, or its machine was.

use std::time::{Duration, Instant};

/// For how long a process may oversleep before that counts as a stall: longer than what other
/// processes take from it on a machine that keeps up.
pub const STALL: Duration = Duration::from_millis(20);
/// From which length on the user is told of a stall.
const TOLD: Duration = Duration::from_millis(500);

/// For how long a process did not run that waited until `until` at most, and runs again `now`;
/// `None` if it ran.
pub fn stall(until: Instant, now: Instant) -> Option<Duration> {
    let overslept = now.saturating_duration_since(until);
    (overslept > STALL).then_some(overslept)
}

/// Tells the user that a role, like "the plant", did not run for so long, and what that meant.
pub fn tell(role: &str, stall: Duration, consequence: &str) {
    if stall >= TOLD {
        let seconds = stall.as_secs_f64();
        tracing::warn!(
            "{role} did not run for {seconds:.1} s, because it was stopped or its machine was; \
             {consequence}"
        );
    }
}
