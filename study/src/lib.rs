//! Studies of `mtj`: many runs instead of one.
//!
//! | module | what it does |
//! |---|---|
//! | [`experiment`] | one run within this process |
//! | [`sweep`] | all points of a plan: a scenario and axes |
//! | [`predict`] | the largest latency that a loop stands, by theory and by simulation |
//! | [`best`] | the best gains of each law at each point of a plan |
//! | [`tune`] | gains, memory and prediction for what is wanted |
//! | [`report`] | the results of a sweep as a page and as figures |
//! | [`shell`] | the command that repeats one run |

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub mod best;
pub mod error;
pub mod experiment;
mod margin;
pub mod predict;
pub mod report;
pub mod shell;
pub mod sweep;
pub mod tune;

pub use error::StudyError;
