//! The plant: an engine that moves an arm, and all that stands between it and a controller.
//!
//! ```text
//! agenda ──Sample──▶ sensor ──▶ state link ──Deliver──▶ exchange ──▶ (a controller, somewhere)
//!        ◀─Arrive── torque link ◀──────────────────────────┘
//! actuator holds ──▶ engine integrates to the next event
//! ```
//!
//! [`plant`] is the loop of events, [`sequencer`] its rules, `clock` what waiting means.

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub mod actuator;
pub mod agenda;
mod clock;
pub mod course;
pub mod direct;
pub mod dormand_prince;
pub mod durations;
pub mod engine;
pub mod error;
mod gravity;
pub mod link;
mod peer;
pub mod plant;
pub mod report;
mod request;
pub mod run_id;
pub mod sensor;
pub mod sequencer;
pub mod summary;
pub mod trace;
mod tracking;
