//! Watches a session: subscribes to everything that is said in it, and shows or records it.
//!
//! ```text
//! monitor   the loop: a source (bus or recording) and its audience
//! overview  what is known of a session by now
//! lines     an audience: a line of text a second
//! fleet     many sessions at once: a table with a line for each
//! terminal  an audience: a dashboard in the terminal
//! desk      an audience: takes knob turns from dashboards to the plant
//! recording an audience: every message in a file; and such a file as a source
//! web       an audience: the dashboard in a browser
//! foxglove  an audience: live to Foxglove (a feature that is off by default)
//! ```

pub mod desk;
pub mod durations;
pub mod fleet;
#[cfg(feature = "foxglove")]
pub mod foxglove;
pub mod lines;
pub mod monitor;
pub mod overview;
pub mod recording;
pub mod terminal;
pub mod web;
