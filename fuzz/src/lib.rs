//! What others may send, as fuzz targets: each takes any bytes, and panics if what they are read by
//! breaks a promise.
//!
//! ```text
//! samples    bytes of a bus: every sample, and the offer of a scenario
//! session    a whole conversation, as a monitor hears it
//! scenario   the TOML of an experiment, and what is set in it
//! study      the TOML of a study
//! words      durations, members, overrides, replayed latencies
//! knob       a knob as a dashboard turns it, in JSON
//! recording  an MCAP file, and the JSON in it
//! dashboard  what a browser sends to the dashboard's server
//! ```
//!
//! `fuzz/run` drives them with libFuzzer; the tests here hold them against the committed corpus.

mod dashboard;
mod samples;
mod session;
mod texts;

pub use dashboard::dashboard;
pub use samples::samples;
pub use session::{recording, session};
pub use texts::{knob, scenario, study, words};

/// A target's name and the target.
pub type Target = (&'static str, fn(&[u8]));

/// All targets; each has a file in `fuzz_targets` and a folder in `corpus`.
pub const TARGETS: [Target; 8] = [
    ("samples", samples),
    ("session", session),
    ("scenario", scenario),
    ("study", study),
    ("words", words),
    ("knob", knob),
    ("recording", recording),
    ("dashboard", dashboard),
];
