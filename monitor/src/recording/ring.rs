//! The newest messages, in bounded memory.

use std::{
    collections::VecDeque,
    mem,
    sync::Arc,
    time::{Duration, Instant},
};

use mtj_protocol::port::Message;

/// How many messages one block has at most.
const BLOCK: usize = 256;
/// A block is closed after this part of the time that is kept.
const PARTS: u32 = 16;

/// A message and its log time, ns since 1970.
pub(super) type Logged = (u64, Message);

/// The messages of the last seconds, or as many as fit into a limit of memory.
///
/// They are in blocks that a thread can write without a copy being made. The oldest block goes as a
/// whole, so a little more than the time that was asked for is kept.
#[derive(Debug)]
pub(super) struct Ring {
    time: Duration,
    memory: usize,
    blocks: VecDeque<Block>,
    open: Vec<Logged>,
    opened: Instant,
    /// When the newest message came.
    newest: Instant,
    /// How many bytes all blocks have, with the open one.
    bytes: usize,
    open_bytes: usize,
    /// The scenario that was in effect before the first block.
    scenario: Option<Message>,
    /// How many messages had to go before their time.
    crowded_out: u64,
}

#[derive(Debug)]
struct Block {
    messages: Arc<Vec<Logged>>,
    begin: Instant,
    end: Instant,
    bytes: usize,
}

/// What a ring held at one moment.
#[derive(Debug)]
pub(super) struct Snapshot {
    /// The scenario in effect at the beginning.
    pub scenario: Option<Message>,
    pub blocks: Vec<Arc<Vec<Logged>>>,
    /// From the first to the last message.
    pub time: Duration,
}

impl Ring {
    /// Keeps the messages of this time in this many bytes.
    pub(super) fn new(time: Duration, memory: usize) -> Self {
        let now = Instant::now();
        Self {
            time,
            memory,
            blocks: VecDeque::new(),
            open: Vec::with_capacity(BLOCK),
            opened: now,
            newest: now,
            bytes: 0,
            open_bytes: 0,
            scenario: None,
            crowded_out: 0,
        }
    }

    /// Adds a message that came at `now`; the oldest ones make room.
    pub(super) fn push(&mut self, now: Instant, log_time: u64, message: Message) {
        let is_old = now.duration_since(self.opened) > self.time / PARTS;
        if self.open.len() == BLOCK || (is_old && !self.open.is_empty()) {
            self.close();
        }
        if self.open.is_empty() {
            self.opened = now;
        }
        self.newest = now;
        let bytes = size(&message);
        self.bytes += bytes;
        self.open_bytes += bytes;
        self.open.push((log_time, message));
        while self.blocks.front().is_some_and(|block| now - block.end > self.time) {
            self.drop_oldest();
        }
        while self.bytes > self.memory && !self.blocks.is_empty() {
            self.crowded_out += self.drop_oldest();
        }
    }

    fn close(&mut self) {
        let messages = Arc::new(mem::replace(&mut self.open, Vec::with_capacity(BLOCK)));
        let bytes = mem::take(&mut self.open_bytes);
        self.blocks.push_back(Block { messages, begin: self.opened, end: self.newest, bytes });
    }

    fn drop_oldest(&mut self) -> u64 {
        let Some(block) = self.blocks.pop_front() else { return 0 };
        self.bytes -= block.bytes;
        let is_scenario = |(_, message): &&Logged| matches!(message, Message::Scenario(_));
        if let Some((_, scenario)) = block.messages.iter().rfind(is_scenario) {
            self.scenario = Some(scenario.clone());
        }
        block.messages.len() as u64
    }

    /// How many messages had to go before their time, because there is too little memory.
    pub(super) fn crowded_out(&self) -> u64 {
        self.crowded_out
    }

    /// All that it holds; `None` if there is nothing.
    pub(super) fn snapshot(&mut self) -> Option<Snapshot> {
        if !self.open.is_empty() {
            self.close();
        }
        let begin = self.blocks.front()?.begin;
        Some(Snapshot {
            scenario: self.scenario.clone(),
            blocks: self.blocks.iter().map(|block| Arc::clone(&block.messages)).collect(),
            time: self.newest - begin,
        })
    }
}

/// How much memory a message takes.
fn size(message: &Message) -> usize {
    let text = match message {
        Message::Scenario(offered) => offered.scenario.text().len(),
        _ => 0,
    };
    size_of::<Logged>() + text
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot go on should say so")]

    use mtj_protocol::sample::{Header, StateSample};

    use super::*;

    const LONG: Duration = Duration::from_secs(30);

    fn state(sequence: u64) -> Message {
        let header = Header { run: 1, sequence, ..Header::default() };
        Message::State(StateSample { header, ..Default::default() })
    }

    fn held(ring: &mut Ring) -> Vec<u64> {
        let blocks = ring.snapshot().unwrap().blocks;
        blocks.iter().flat_map(|block| block.iter().map(|(log_time, _)| *log_time)).collect()
    }

    #[test]
    fn at_least_the_time_is_kept_and_a_sixteenth_more_at_most() {
        for (period_ms, count) in [(1, 100_000), (40, 3000), (4000, 40)] {
            let mut ring = Ring::new(LONG, usize::MAX);
            let begin = Instant::now();
            for i in 0..count {
                let now = begin + Duration::from_millis(i * period_ms);
                ring.push(now, i, state(i));
            }
            let held = held(&mut ring);
            let kept = 30_000 / period_ms;
            let most = kept + kept / 16 + BLOCK as u64;
            assert!((kept..=most).contains(&(held.len() as u64)), "{period_ms}: {}", held.len());
            assert!(held.windows(2).all(|pair| pair[1] == pair[0] + 1), "without a gap");
            assert_eq!(held.last(), Some(&(count - 1)));
            assert_eq!(ring.crowded_out(), 0);
        }
    }

    #[test]
    fn no_more_memory_is_taken_than_allowed_and_what_goes_early_is_counted() {
        let memory = 4000 * size(&state(0));
        let mut ring = Ring::new(LONG, memory);
        let now = Instant::now();
        for i in 0..100_000 {
            ring.push(now, i, state(i));
            assert!(ring.bytes <= memory, "{} bytes", ring.bytes);
        }
        let held = held(&mut ring);
        assert!(held.len() as u64 >= 4000 - BLOCK as u64, "{}", held.len());
        assert_eq!(ring.crowded_out() + held.len() as u64, 100_000);
    }
}
