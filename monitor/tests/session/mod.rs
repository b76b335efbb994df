//! Messages of a made-up session, for tests that need no processes.

use std::sync::Arc;

use mtj_model::scenario::Scenario;
use mtj_protocol::{
    member::Role,
    port::{Message, Offered},
    sample::{
        ErrorSample, Header, PresenceSample, StateSample, StatusSample, TorqueSample, VERSION,
        padded, text,
    },
};

/// The sample period of the session, ns.
pub const PERIOD_NS: u64 = 1_000_000;
/// The id of its controller.
pub const CONTROLLER: u64 = 77;
/// Its run.
pub const RUN: u64 = 5;

pub fn scenario() -> Scenario {
    Scenario::load("sampled/mtj", &[]).unwrap()
}

pub fn offered(revision: u32) -> Message {
    Message::Scenario(Arc::new(Offered { run: RUN, revision, scenario: scenario() }))
}

pub fn header(sequence: u64) -> Header {
    let time_ns = sequence * PERIOD_NS;
    Header { version: VERSION, joints: 2, axes: 2, revision: 0, run: RUN, sequence, time_ns }
}

/// Numbers that compress badly, different for each sample.
fn noise(sequence: u64, which: u64) -> [f64; 2] {
    let mut bits = sequence.wrapping_mul(31).wrapping_add(which).wrapping_add(1);
    [0, 1].map(|_| {
        bits = bits.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    })
}

pub fn state(sequence: u64) -> Message {
    let position = padded(&noise(sequence, 0));
    Message::State(StateSample { header: header(sequence), position, ..Default::default() })
}

pub fn torque(sequence: u64) -> Message {
    let (torque, controller) = (padded(&noise(sequence, 1)), CONTROLLER);
    Message::Torque(TorqueSample {
        header: header(sequence),
        controller,
        torque,
        ..Default::default()
    })
}

pub fn error(sequence: u64) -> Message {
    let error = padded(&noise(sequence, 2));
    let (header, law) = (header(sequence), text("mtj"));
    Message::Error(ErrorSample { header, law, error, ..Default::default() })
}

/// A status of a run that goes on.
pub fn status(sequence: u64) -> Message {
    Message::Status(StatusSample { header: header(sequence), phase: 1, ..Default::default() })
}

pub fn presence(id: u64, role: Role) -> Message {
    let (header, host) = (header(0), text("robot"));
    Message::Presence(PresenceSample { header, id, role: role as u64, host, ..Default::default() })
}

/// What is heard of a sampling instant.
pub fn instant(sequence: u64) -> [Message; 3] {
    [state(sequence), torque(sequence), error(sequence)]
}
