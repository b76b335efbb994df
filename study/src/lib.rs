//! Everything that `mtj` does with the roles: launch them, run them, compare them.

pub mod bench;
pub mod command;
pub mod experiment;
pub mod failure;
pub mod figure;
pub mod latency;
pub mod launcher;
pub mod paper;
pub mod predict;
pub mod replay;
pub mod report;
pub mod session;
pub mod sweep;
pub mod tune;
