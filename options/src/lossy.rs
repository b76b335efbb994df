//! Output that drops lines rather than hold up its writer.
//!
//! A terminal may stop taking output: the user pressed Ctrl-S, or the network to it is gone. A role
//! that waited for it would lose samples. So a thread of its own writes; what it has no room for is
//! dropped and counted.

use std::{
    io::{self, Write},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
        mpsc::{self, Receiver, SyncSender, TrySendError},
    },
    thread,
    time::{Duration, Instant},
};

/// How many pieces, most of them lines, may wait for the thread.
const WAITING: usize = 1024;
/// How long [`LossyWriter::finish`] waits for an output that takes nothing.
const PATIENCE: Duration = Duration::from_millis(500);

/// The writing end; its clones share one thread.
#[derive(Clone, Debug)]
pub struct LossyWriter {
    pieces: SyncSender<Piece>,
    dropped: Arc<AtomicU64>,
}

#[derive(Debug)]
enum Piece {
    Bytes(Vec<u8>),
    /// Answered when everything before it is written.
    End(SyncSender<()>),
}

impl LossyWriter {
    /// Writes to `out` from now on.
    ///
    /// # Errors
    ///
    /// The system refuses a thread.
    pub fn new(out: impl Write + Send + 'static) -> io::Result<Self> {
        let (pieces, arriving) = mpsc::sync_channel(WAITING);
        thread::Builder::new().name("output".to_owned()).spawn(move || pass_on(&arriving, out))?;
        Ok(Self { pieces, dropped: Arc::default() })
    }

    /// Waits until everything is written, though not long for an output that takes nothing.
    pub fn finish(&self) {
        let end = Instant::now() + PATIENCE;
        let (done, is_done) = mpsc::sync_channel(1);
        let mut piece = Piece::End(done);
        while let Err(TrySendError::Full(again)) = self.pieces.try_send(piece) {
            if Instant::now() >= end {
                return;
            }
            piece = again;
            thread::sleep(Duration::from_millis(1));
        }
        let _ = is_done.recv_timeout(end.saturating_duration_since(Instant::now()));
    }
}

/// Writes what arrives until the output fails.
fn pass_on(arriving: &Receiver<Piece>, mut out: impl Write) {
    for piece in arriving {
        let written = match piece {
            Piece::Bytes(bytes) => out.write_all(&bytes),
            Piece::End(done) => {
                let _ = done.send(());
                Ok(())
            }
        };
        if written.and_then(|()| out.flush()).is_err() {
            return;
        }
    }
}

impl Write for LossyWriter {
    /// Takes all bytes.
    ///
    /// # Errors
    ///
    /// The output is gone, as when the reader of a pipe has ended.
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let dropped = self.dropped.swap(0, Relaxed);
        let note = match dropped {
            0 => String::new(),
            count => format!("({count} lines were dropped)\n"),
        };
        match self.pieces.try_send(Piece::Bytes([note.as_bytes(), bytes].concat())) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => {
                self.dropped.fetch_add(dropped + 1, Relaxed);
            }
            Err(TrySendError::Disconnected(_)) => return Err(io::ErrorKind::BrokenPipe.into()),
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    /// An output that takes nothing until it is released.
    #[derive(Clone, Default)]
    struct Held {
        written: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Held {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.written.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_held_output_costs_lines_and_no_time_and_the_loss_is_told() {
        let held = Held::default();
        let mut writer = LossyWriter::new(held.clone()).unwrap();
        let hold = held.written.lock().unwrap();
        for line in 0..5000 {
            writeln!(writer, "{line}").unwrap();
        }
        drop(hold);
        writer.finish();
        writeln!(writer, "the last").unwrap();
        writer.finish();
        let text = String::from_utf8(held.written.lock().unwrap().clone()).unwrap();
        assert!(text.starts_with("0\n1\n2\n"), "{text}");
        assert!(text.contains(" lines were dropped)\n"), "{text}");
        assert!(text.ends_with("the last\n"), "{text}");
    }

    #[test]
    fn an_output_that_is_gone_is_an_error() {
        let (reader, out) = io::pipe().unwrap();
        drop(reader);
        let mut writer = LossyWriter::new(out).unwrap();
        let mut is_error = || {
            thread::sleep(Duration::from_millis(1));
            writeln!(writer, "line").is_err()
        };
        assert!((0..5000).any(|_| is_error()));
    }
}
