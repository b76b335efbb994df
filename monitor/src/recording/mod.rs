//! Recordings: every message of a session in an MCAP file, as JSON that describes itself.
//!
//! ```text
//! options   the command line
//! recorder  an audience: hands messages to a thread that writes them
//! timeline  when a message was, by the wall clock
//! file      the MCAP file that is written: a finished chunk at least every second
//! reading   a recording, finished or cut short, message by message
//! player    a source: plays a recording at any speed
//! json      messages as JSON and back
//! schema    what the JSON looks like, and in which units
//! topic     under which names messages are recorded
//! ```

mod file;
mod json;
pub mod options;
mod player;
mod reading;
mod recorder;
mod schema;
mod timeline;
mod topic;

pub use self::{
    json::{read as read_json, write as write_json},
    player::Player,
    reading::{Recorded, Recording},
    recorder::Recorder,
    schema::{schema, unit},
    timeline::Timeline,
    topic::{TOPICS, Topic, fields, header},
};
