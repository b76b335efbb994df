//! Recordings: every message of a session in an MCAP file, as self-describing JSON.
//!
//! ```text
//! options       the command line
//! recorder      a sink: passes messages to a thread that writes them
//! ring_recorder a sink: keeps the last seconds, and saves them when something happens
//! ring          the newest messages, in bounded memory
//! save          requests to save what a ring recorder holds
//! timeline      the wall-clock time of a message
//! gaps          states that never came
//! writer        writes an MCAP file: a finished chunk at least every second
//! parts         writes one file, or one numbered file after another
//! split         when a recording goes on in another file
//! numbered      numbered files
//! reader        reads a recording, finished or cut short, message by message
//! player        a source: plays a recording at any speed
//! json          messages as JSON and back
//! schema        the JSON schema of each topic, with units
//! topic         under which names messages are recorded
//! error         why a recording cannot be written or read
//! ```

mod error;
mod gaps;
mod json;
mod numbered;
pub mod options;
mod parts;
mod player;
mod reader;
mod recorder;
mod ring;
mod ring_recorder;
mod save;
mod schema;
mod split;
mod timeline;
mod topic;
mod writer;

pub use self::{
    error::{MessageError, RecordingError},
    json::{read as read_json, write as write_json},
    player::Player,
    reader::{RecordedMessage, Recording},
    recorder::Recorder,
    ring_recorder::RingRecorder,
    save::{SaveError, SaveHandle, SaveOutcome},
    schema::{is_echo, schema, unit},
    timeline::Timeline,
    topic::{TOPICS, Topic, fields, header},
};
