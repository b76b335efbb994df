//! Makes messages that somebody hostile, or something broken, could send.

use std::collections::HashMap;

/// The topics of a session.
pub const TOPICS: [&str; 7] =
    ["state", "torque", "error", "status", "request", "change", "presence"];

/// Forges samples from those it has heard.
pub struct Forger {
    heard: HashMap<String, Vec<u8>>,
    random: u64,
}

/// Where the header's fields are, and a torque's `controller`.
const VERSION: usize = 0;
const JOINTS: usize = 4;
const AXES: usize = 8;
const RUN: usize = 16;
const SEQUENCE: usize = 24;
const HEADER: usize = 40;
const CONTROLLER: usize = 56;

impl Forger {
    /// One that has heard nothing yet.
    pub fn new(seed: u64) -> Self {
        Self { heard: HashMap::new(), random: seed }
    }

    /// Takes in a genuine sample.
    pub fn hear(&mut self, topic: &str, bytes: &[u8]) {
        self.heard.insert(topic.to_owned(), bytes.to_vec());
        if topic == "state" {
            // A torque that answers this state, and a request to pause.
            if let Some(torque) = self.heard.get_mut("torque") {
                torque[..HEADER + 8].copy_from_slice(&bytes[..HEADER + 8]);
            }
            let mut request = bytes[..HEADER].to_vec();
            request.resize(496, 0);
            request[HEADER] = 1;
            self.heard.insert("request".to_owned(), request);
        }
    }

    /// Whether the loop has begun: until then, the first to answer takes charge.
    pub fn knows_the_loop(&self) -> bool {
        self.heard.contains_key("torque") && self.heard.contains_key("state")
    }

    /// A number below `bound`, from a congruential generator.
    pub fn below(&mut self, bound: u64) -> u64 {
        self.random =
            self.random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.random >> 33) % bound
    }

    /// Any bytes.
    pub fn rubbish(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.below(256) as u8).collect()
    }

    /// A message for a topic, of any length.
    pub fn message(&mut self, topic: &str) -> Vec<u8> {
        match (self.below(4), self.heard.get(topic).cloned()) {
            (0, _) | (_, None) => {
                let length = self.below(600) as usize;
                self.rubbish(length)
            }
            (1, Some(mut bytes)) => {
                let length = self.below(600) as usize;
                bytes.resize(if length == bytes.len() { length + 1 } else { length }, 0xff);
                bytes
            }
            (_, Some(bytes)) => self.forged(topic, bytes),
        }
    }

    /// A message for a topic, of the right length.
    pub fn sample(&mut self, topic: &str, length: usize) -> Vec<u8> {
        match (self.below(4), self.heard.get(topic).cloned()) {
            (0, _) | (_, None) => self.rubbish(length),
            (_, Some(bytes)) => self.forged(topic, bytes),
        }
    }

    /// A genuine sample, a few bits of which are flipped or whose numbers are none, and that is
    /// nobody's: one field of its header, at least, is wrong.
    fn forged(&mut self, topic: &str, genuine: Vec<u8>) -> Vec<u8> {
        let mut bytes = genuine.clone();
        for _ in 0..self.below(8) {
            let place = HEADER + self.below((bytes.len() - HEADER) as u64) as usize;
            bytes[place] ^= 1 << self.below(8);
        }
        if self.below(4) == 0 {
            let place = bytes.len() - 8;
            let number = [f64::NAN, f64::INFINITY, -f64::INFINITY][self.below(3) as usize];
            bytes[place..].copy_from_slice(&number.to_le_bytes());
        }
        let sequence = u64::from_le_bytes(bytes[SEQUENCE..SEQUENCE + 8].try_into().unwrap());
        let word = |bytes: &mut Vec<u8>, at: usize, word: u64| {
            bytes[at..at + 8].copy_from_slice(&word.to_le_bytes());
        };
        let other = 1 + self.below(250) as u8;
        match (self.below(8), topic) {
            (0, _) => bytes[VERSION] ^= other,
            (1, "state" | "torque") => bytes[JOINTS] ^= other,
            (2, "state" | "torque") => bytes[AXES] ^= other,
            // Older than anything on its way.
            (3, "state" | "torque") if sequence > 100 => {
                let before = sequence - 100 - self.below(sequence - 99);
                word(&mut bytes, SEQUENCE, before);
            }
            // An answer to a state that is not yet measured, or of a controller that is not in
            // charge.
            (4, "torque") => word(&mut bytes, SEQUENCE, sequence + (1 << 40)),
            (5 | 6, "torque") => bytes[CONTROLLER + 3] = genuine[CONTROLLER + 3] ^ other,
            // A state of another arm, newer than all.
            (7, "state") => {
                word(&mut bytes, SEQUENCE, sequence + (1 << 40));
                bytes[JOINTS] = if bytes[JOINTS] == 3 { 4 } else { 3 };
            }
            _ => bytes[RUN + self.below(8) as usize] ^= other,
        }
        bytes
    }
}
