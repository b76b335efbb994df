//! The subcommands of `mtj`, one file each.

pub mod advise;
pub mod bench;
pub mod bridge;
#[cfg(feature = "zenoh")]
pub mod certs;
pub mod completions;
pub mod export;
pub mod latency;
pub mod monitor;
pub mod paper;
pub mod plant;
pub mod predict;
pub mod replay;
pub mod report;
pub mod request;
pub mod run;
pub mod scenario;
pub mod study;
pub mod tune;
pub mod up;
