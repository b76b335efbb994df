//! What the programs of `mtj` share: options of the command line, and logs on standard error.
//!
//! Each role shows only the options that apply to it:
//!
//! | options | for |
//! |---|---|
//! | [`SessionOptions`] | all: which loop on which bus |
//! | [`JoinOptions`] | roles that connect to a plant |
//! | [`BusOptions`] | commands that run a plant: it listens, and says how the loop waits |
//! | [`RealtimeOptions`] | both ends of a loop |

#![warn(clippy::print_stderr, clippy::print_stdout)]

mod bus;
pub mod log;
pub mod lossy;
mod realtime;

pub use bus::{BusOptions, JoinOptions, SessionOptions};
pub use realtime::RealtimeOptions;
