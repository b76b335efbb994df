//! A control law on a bus: memory, prediction, standby.
//!
//! [`Controller::respond`] is the whole of it: one measured state in, one torque out. Around it,
//! [`serve`] puts it on a bus. Inside it, following one sample:
//!
//! ```text
//! state ─▶ configuration ─▶ prediction ─▶ tracking error ─▶ law + memory ─▶ torque and echo
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub mod controller;
pub mod memory;
pub mod prediction;
#[cfg(feature = "program")]
pub mod program;
pub mod responder;
pub mod serve;

pub use controller::{Controller, LawError};
