//! Wall time for a run in real time.

use std::time::{Duration, Instant};

/// Maps the run's time, ns from its start, to absolute instants of the monotonic clock, so that no
/// error adds up over a run.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    origin: Instant,
}

/// Asks the kernel to wake this thread when a deadline is due, not up to 50 µs later, as it may
/// otherwise to save power: at a sampling instant that would be latency.
pub fn wake_punctually() {
    #[cfg(target_os = "linux")]
    {
        // Where it is refused, waking is a little less punctual; the round trips show it.
        let _ = nix::sys::prctl::set_timerslack(1);
    }
}

impl Clock {
    /// A clock that reads zero now.
    pub fn start() -> Self {
        Self { origin: Instant::now() }
    }

    /// Puts the clock back by how long it stood still.
    pub fn stood_still(&mut self, duration: Duration) {
        self.origin += duration;
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
