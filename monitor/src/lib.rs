//! The monitor: displays and records every message of a session.
//!
//! A [`Source`](monitor::Source), a bus or a recording, supplies messages. [`monitor::run`] passes
//! each message to all [`Sink`](monitor::Sink)s.
//!
//! ```text
//! monitor   the loop, sources and sinks
//! filter    leaves samples out on purpose, before displays and recordings
//! overview  what is known of a session; all displays show the same
//! lines     a sink: one line of text a second
//! terminal  a sink: the dashboard in the terminal
//! web       a sink: the dashboard in a browser
//! recording a sink: every message in a file; and such a file as a source
//! foxglove  a sink: live data for Foxglove (a feature that is off by default)
//! requests  a sink: sends requests of dashboards to the plant and returns the answers
//! fleet     many sessions at once: a table with one line for each
//! error     why a monitor could not start or go on
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout)]

pub mod durations;
pub mod error;
pub mod filter;
pub mod fleet;
#[cfg(feature = "foxglove")]
pub mod foxglove;
pub mod lines;
pub mod monitor;
pub mod overview;
pub mod recording;
pub mod requests;
pub mod terminal;
pub mod web;
