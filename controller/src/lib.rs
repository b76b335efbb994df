//! The control laws and their memory.
//!
//! [`Controller::respond`] is the whole of it: one measured state in, one torque out. Around it,
//! [`serve`] puts it on a bus. Inside it, following one sample:
//!
//! ```text
//! state ─▶ pose ─▶ predictor ─▶ tracking error ─▶ law (tj | mtj + memory | mb) ─▶ Q̂ ─▶ τ = Jᵀ Q̂
//! ```

pub mod controller;
pub mod law;
pub mod memory;
pub mod options;
pub mod prediction;
pub mod responder;
pub mod serve;

pub use controller::{Controller, LawError};
