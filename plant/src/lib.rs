//! The simulated arm, and the agenda that decides what happens when.
//!
//! ```text
//! agenda ──Sample──▶ sensor ──▶ state link ──Deliver──▶ exchange ──▶ (a controller, somewhere)
//!        ◀─Arrive── torque link ◀──────────────────────────┘
//! actuator holds ──▶ simulator integrates to the next event
//! ```

pub mod actuator;
pub mod agenda;
pub mod clock;
pub mod direct;
pub mod dormand_prince;
pub mod durations;
mod knobs;
pub mod ledger;
pub mod link;
pub mod options;
pub mod plant;
pub mod report;
pub mod sensor;
pub mod simulator;
pub mod summary;
pub mod trace;
mod turning;
