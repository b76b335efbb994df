//! What is said on standard error while the screen is in use.

use std::{
    collections::VecDeque,
    io::{self, BufRead, BufReader},
    os::fd::{AsFd, OwnedFd},
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{self, Receiver},
    },
    thread,
    time::{Duration, Instant},
};

use rustix::stdio;

/// How many lines are kept until the screen is left.
const KEPT: usize = 200;
/// How long to wait, in the end, for what was said last.
const PATIENCE: Duration = Duration::from_millis(500);

/// Catches the lines that this process writes to standard error: on the screen they would land
/// anywhere. They are shown in a line of their own, and said again when the screen is left.
pub struct StderrCapture {
    original: OwnedFd,
    said: Said,
    silent: Receiver<()>,
}

/// What was said.
#[derive(Clone, Default)]
pub struct Said(Arc<Mutex<Lines>>);

#[derive(Default)]
struct Lines {
    kept: VecDeque<String>,
    dropped: u64,
    newest: Option<Instant>,
}

impl StderrCapture {
    /// From now on standard error is caught.
    pub fn catch() -> io::Result<Self> {
        let original = stdio::stderr().try_clone_to_owned()?;
        let (reader, writer) = io::pipe()?;
        let said = Said::default();
        let (ended, silent) = mpsc::channel();
        let ear = said.clone();
        thread::Builder::new().name("stderr_capture".to_owned()).spawn(move || {
            for line in BufReader::new(reader).split(b'\n').map_while(Result::ok) {
                ear.take_in(&String::from_utf8_lossy(&line));
            }
            drop(ended);
        })?;
        stdio::dup2_stderr(writer.as_fd())?;
        Ok(Self { original, said, silent })
    }

    /// What was said, as it comes.
    pub fn said(&self) -> Said {
        self.said.clone()
    }

    /// Gives standard error back, and says there what was caught.
    pub fn release(self) {
        if stdio::dup2_stderr(self.original.as_fd()).is_err() {
            return;
        }
        // Standard error was the last end of the pipe to write to, so the other end closes.
        let _ = self.silent.recv_timeout(PATIENCE);
        let lines = self.said.lock();
        for line in &lines.kept {
            eprintln!("{line}");
        }
        if lines.dropped > 0 {
            eprintln!("mtj: {} more lines were not kept", lines.dropped);
        }
    }
}

impl Said {
    fn lock(&self) -> std::sync::MutexGuard<'_, Lines> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take_in(&self, line: &str) {
        let mut lines = self.lock();
        if lines.kept.len() == KEPT {
            lines.dropped += 1;
            lines.kept.pop_front();
        }
        // What moves a cursor or clears a screen is not for showing.
        lines.kept.push_back(line.chars().filter(|c| !c.is_control()).collect());
        lines.newest = Some(Instant::now());
    }

    /// The newest line, unless it is older than `age`.
    pub fn newest(&self, age: Duration) -> Option<String> {
        let lines = self.lock();
        lines.newest.filter(|said| said.elapsed() < age)?;
        lines.kept.back().cloned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_bounded_and_cannot_steer_the_terminal() {
        let said = Said::default();
        for number in 0..=KEPT {
            said.take_in(&format!("\x1b[2Jline {number}\r"));
        }
        assert_eq!(said.newest(Duration::from_secs(60)).as_deref(), Some("[2Jline 200"));
        let lines = said.lock();
        assert_eq!((lines.kept.len(), lines.dropped), (KEPT, 1));
        assert_eq!(lines.kept[0], "[2Jline 1");
    }
}
