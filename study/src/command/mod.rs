//! The subcommands of `mtj`, one file each.

pub mod bench;
pub mod bridge;
#[cfg(feature = "zenoh")]
pub mod certs;
pub mod completions;
pub mod export;
pub mod knob;
pub mod latency;
pub mod paper;
pub mod predict;
pub mod replay;
pub mod report;
pub mod run;
pub mod scenario;
pub mod study;
pub mod tune;
pub mod up;
pub mod which;
