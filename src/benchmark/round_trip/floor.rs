//! The floor: one cache line, passed to and fro between two cores.

use std::{
    hint::spin_loop,
    sync::atomic::{AtomicU64, Ordering},
    thread,
    time::Instant,
};

use mtj_plant::durations::Durations;
use mtj_protocol::realtime::Realtime;

use super::Effort;
use crate::failure::Failure;

/// A cache line of its own, and the one that is fetched beside it.
#[repr(align(128))]
struct Line(AtomicU64);

/// Round trips of a number that one thread makes odd and the other even.
pub(crate) fn measure(effort: &Effort) -> Result<Durations, Failure> {
    let line = Line(AtomicU64::new(0));
    let mut trips = Durations::default();
    let ping = Realtime::from(&effort.realtime.plant());
    let pong = Realtime::from(&effort.realtime.controller());
    let samples = effort.samples;
    thread::scope(|scope| {
        let echo = scope.spawn(|| {
            let pinned = pong.before_the_loop();
            for k in 0..samples {
                pass(&line, 2 * k + 1, 2 * k + 2);
            }
            pinned
        });
        // A thread of its own, so that pinning it pins nothing else.
        let asking = scope.spawn(|| {
            let pinned = ping.before_the_loop();
            for k in 0..samples {
                let began = Instant::now();
                line.0.store(2 * k + 1, Ordering::Release);
                while line.0.load(Ordering::Acquire) != 2 * k + 2 {
                    spin_loop();
                }
                trips.record(began.elapsed().as_nanos() as u64);
            }
            pinned
        });
        for thread in [asking, echo] {
            thread.join().map_err(|_| Failure::other("the cache line's thread panicked"))??;
        }
        Ok::<(), Failure>(())
    })?;
    Ok(trips)
}

fn pass(line: &Line, expected: u64, next: u64) {
    while line.0.load(Ordering::Acquire) != expected {
        spin_loop();
    }
    line.0.store(next, Ordering::Release);
}
