//! The keys of a terminal.

use std::{
    fs::{File, OpenOptions},
    io,
    os::fd::{AsFd, BorrowedFd},
    time::{Duration, Instant},
};

use rustix::{
    event::{PollFd, PollFlags, Timespec, poll},
    io::Errno,
    stdio,
    termios::{isatty, ttyname},
};

/// How long after an escape byte the rest of a sequence, as of an arrow key, may come.
const ESCAPE: Duration = Duration::from_millis(60);

/// The command of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    /// Close the dashboard.
    Quit,
    /// Stop the view, or let it go on.
    Hold,
    /// Show more time on the charts.
    Longer,
    /// Show less time on the charts.
    Shorter,
    /// Show what the keys do.
    Help,
}

/// The terminal of the dashboard, to read from.
///
/// crossterm could read keys too, but its reader never returns from a terminal that was closed.
pub(super) enum Keyboard {
    /// Standard input.
    Standard,
    /// The terminal of standard output, if standard input is not a terminal: it may be a pipe by
    /// which another process stops this one.
    Opened(File),
}

impl Keyboard {
    /// Opens the terminal.
    pub(super) fn open() -> io::Result<Self> {
        if isatty(stdio::stdin()) {
            return Ok(Self::Standard);
        }
        let name = ttyname(stdio::stdout(), Vec::new())?;
        let path = name.to_string_lossy().into_owned();
        Ok(Self::Opened(OpenOptions::new().read(true).write(true).open(path)?))
    }

    /// The bytes since the last call, without waiting; `None` when the terminal is gone.
    pub(super) fn read(&self) -> Option<Vec<u8>> {
        let mut bytes = [0; 64];
        let terminal = self.as_fd();
        let mut ready = [PollFd::new(&terminal, PollFlags::IN)];
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        match poll(&mut ready, Some(&now)) {
            Ok(0) | Err(Errno::INTR) => Some(Vec::new()),
            Ok(_) => match rustix::io::read(self.as_fd(), &mut bytes) {
                Ok(0) => None,
                Ok(count) => Some(bytes[..count].to_vec()),
                Err(Errno::INTR | Errno::AGAIN) => Some(Vec::new()),
                Err(_) => None,
            },
            Err(_) => None,
        }
    }
}

impl AsFd for Keyboard {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Standard => stdio::stdin(),
            Self::Opened(file) => file.as_fd(),
        }
    }
}

/// Turns bytes into keys; a sequence may come in pieces.
#[derive(Default)]
pub(super) struct Decoder {
    state: State,
}

#[derive(Default)]
enum State {
    #[default]
    Plain,
    /// After an escape byte.
    Escaped(Instant),
    /// Within the sequence of another key, as of an arrow key, which is ignored.
    Sequence,
}

impl Decoder {
    /// The keys in the bytes that came by `now`. To be called without bytes too: an escape byte
    /// that stays alone is a key.
    pub(super) fn keys(&mut self, bytes: &[u8], now: Instant) -> Vec<Key> {
        let mut keys = Vec::new();
        for byte in bytes {
            self.state = match (&self.state, byte) {
                (State::Plain | State::Escaped(_), 0x1b) => State::Escaped(now),
                (State::Escaped(_), b'[' | b'O') => State::Sequence,
                (State::Sequence, 0x40..=0x7e) => State::Plain,
                (State::Sequence, _) => State::Sequence,
                // A key with Alt comes after an escape byte; it acts as without Alt.
                (State::Plain | State::Escaped(_), _) => {
                    keys.extend(key(*byte));
                    State::Plain
                }
            };
        }
        if matches!(self.state, State::Escaped(since) if now.duration_since(since) >= ESCAPE) {
            self.state = State::Plain;
            keys.push(Key::Quit);
        }
        keys
    }
}

fn key(byte: u8) -> Option<Key> {
    const CTRL_C: u8 = 3;
    const CTRL_D: u8 = 4;
    match byte {
        b'q' | b'Q' | CTRL_C | CTRL_D => Some(Key::Quit),
        b' ' => Some(Key::Hold),
        b'+' | b'=' => Some(Key::Longer),
        b'-' | b'_' => Some(Key::Shorter),
        b'?' | b'h' => Some(Key::Help),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_escape_alone_quits_and_an_arrow_key_does_not() {
        let now = Instant::now();
        let later = now + Duration::from_secs(1);
        let mut decoder = Decoder::default();
        assert_eq!(decoder.keys(b"\x1b[A \x1bOB\x1b[1;5C+", now), [Key::Hold, Key::Longer]);
        // In pieces, as over a slow line.
        assert_eq!(decoder.keys(b"\x1b", now), []);
        assert_eq!(decoder.keys(b"[", now), []);
        assert_eq!(decoder.keys(b"15", later), []);
        assert_eq!(decoder.keys(b"~q", later), [Key::Quit]);
        assert_eq!(decoder.keys(b"\x1b", now), []);
        assert_eq!(decoder.keys(b"", now), []);
        assert_eq!(decoder.keys(b"", later), [Key::Quit]);
    }

    #[test]
    fn control_c_is_a_key_and_other_bytes_are_ignored() {
        let mut decoder = Decoder::default();
        assert_eq!(decoder.keys(b"\xff\x00xyz\x03", Instant::now()), [Key::Quit]);
        assert_eq!(decoder.keys(b"?-_= ", Instant::now()).len(), 5);
    }
}
