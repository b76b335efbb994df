//! Recordings: every message of a session in an MCAP file, as self-describing JSON.
//!
//! ```text
//! options   the command line
//! recorder  a sink: passes messages to a thread that writes them
//! timeline  the wall-clock time of a message
//! writer    writes an MCAP file: a finished chunk at least every second
//! reader    reads a recording, finished or cut short, message by message
//! player    a source: plays a recording at any speed
//! json      messages as JSON and back
//! schema    the JSON schema of each topic, with units
//! topic     under which names messages are recorded
//! error     why a recording cannot be written or read
//! ```

mod error;
mod json;
pub mod options;
mod player;
mod reader;
mod recorder;
mod schema;
mod timeline;
mod topic;
mod writer;

pub use self::{
    error::{MessageError, RecordingError},
    json::{read as read_json, write as write_json},
    player::Player,
    reader::{RecordedMessage, Recording},
    recorder::Recorder,
    schema::{schema, unit},
    timeline::Timeline,
    topic::{TOPICS, Topic, fields, header},
};
