//! Wall time for a run in real time.

use std::time::{Duration, Instant};

/// Maps the run's time, ns from its start, to absolute instants of the monotonic clock, so that no
/// error adds up over a run.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    origin: Instant,
}

impl Clock {
    /// A clock that reads zero now.
    pub fn start() -> Self {
        Self { origin: Instant::now() }
    }

    /// ns since the run began.
    pub fn now_ns(&self) -> u64 {
        self.origin.elapsed().as_nanos() as u64
    }

    /// The instant at which the run's time is `time_ns`.
    pub fn instant(&self, time_ns: u64) -> Instant {
        self.origin + Duration::from_nanos(time_ns)
    }
}
