//! `mtj` as its users have it: the program itself, in processes that come, go and die, on buses and
//! machines.
//!
//! One binary of modules: `cargo test --release --test mtj failover` runs those of one file.

#![cfg(all(feature = "iceoryx2", feature = "zenoh"))]
#![allow(unreachable_pub, reason = "a test binary has no public surface")]
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a helper that cannot go on fails its test"
)]

mod attack;
mod browser;
mod intruder;
mod machine;
mod machines;
mod needs;
mod session;

mod bad_input;
mod bridge;
mod clock_steps;
mod critical_path;
mod dashboard;
mod dashboards;
mod examples;
mod failover;
mod failures;
mod faults;
mod fleet;
mod foreign;
mod hostile;
mod knobs;
mod latency;
mod lockstep;
mod lossy;
mod monitors;
mod promises;
mod realtime;
mod recording;
mod security;
mod shared_memory;
mod soak;
mod starting;
mod study;
mod terminal;
mod tune;
mod two_machines;
