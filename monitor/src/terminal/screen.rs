//! The terminal, taken over for a while and given back as it was found.

use std::{
    io::{self, IsTerminal, Write, stderr, stdout},
    panic,
    sync::{
        Mutex, Once, PoisonError,
        mpsc::{self, SyncSender, TrySendError},
    },
    thread,
    time::{Duration, Instant},
};

use ratatui::{
    backend::{Backend, CrosstermBackend},
    buffer::Buffer,
    crossterm::{
        cursor::{Hide, Show},
        queue,
        style::ResetColor,
        terminal::{
            BeginSynchronizedUpdate, EndSynchronizedUpdate, EnterAlternateScreen,
            LeaveAlternateScreen,
        },
    },
    layout::Rect,
};
use rustix::{
    stdio,
    termios::{self, OptionalActions, Termios},
};

use super::{
    keyboard::Keyboard,
    stderr_capture::{Said, StderrCapture},
};

/// How often everything is drawn anew, in case another process has written to the terminal.
const REPAINT: Duration = Duration::from_secs(3);
/// How long a terminal may take to accept the last frame before it is left without more ado.
const PATIENCE: Duration = Duration::from_secs(1);

/// A full screen to draw on.
///
/// Frames go to the terminal on a thread of their own, and one that is still on its way makes the next
/// ones wait: a slow line drops frames, not samples.
pub struct Screen {
    keyboard: Keyboard,
    frames: SyncSender<Vec<u8>>,
    said: Said,
    shown: Option<Buffer>,
    repaint: Instant,
}

/// What it takes to give the terminal back.
struct Taken {
    settings: Termios,
    terminal: Keyboard,
    stderr_capture: Option<StderrCapture>,
}

/// The terminal, while it is taken over: there is one, and a panic on any thread must find it.
static TAKEN: Mutex<Option<Taken>> = Mutex::new(None);
/// Held while a frame is written; true when there must be no more.
static CLOSED: Mutex<bool> = Mutex::new(false);

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Screen {
    /// Takes the terminal over.
    pub fn open() -> io::Result<Self> {
        let terminal = Keyboard::open()?;
        let settings = termios::tcgetattr(&terminal)?;
        give_back_on_panic();
        let stderr_capture = stderr().is_terminal().then(StderrCapture::catch).transpose()?;
        let said = stderr_capture.as_ref().map(StderrCapture::said).unwrap_or_default();
        *lock(&CLOSED) = false;
        let mut raw = settings.clone();
        raw.make_raw();
        *lock(&TAKEN) = Some(Taken { settings, terminal: Keyboard::open()?, stderr_capture });
        let (frames, arriving) = mpsc::sync_channel::<Vec<u8>>(1);
        let screen =
            Self { keyboard: terminal, frames, said, shown: None, repaint: Instant::now() };
        // From here on the screen gives back what was taken when it is dropped.
        termios::tcsetattr(&screen.keyboard, OptionalActions::Now, &raw)?;
        let mut out = stdout();
        queue!(out, EnterAlternateScreen, Hide)?;
        out.flush()?;
        thread::Builder::new().name("screen".to_owned()).spawn(move || {
            for frame in arriving {
                let closed = lock(&CLOSED);
                let mut out = stdout();
                if *closed || out.write_all(&frame).and_then(|()| out.flush()).is_err() {
                    return;
                }
            }
        })?;
        Ok(screen)
    }

    /// What was typed; `None` when the terminal is gone.
    pub fn typed(&self) -> Option<Vec<u8>> {
        self.keyboard.typed()
    }

    /// What this process has lately said on standard error.
    pub fn said(&self) -> &Said {
        &self.said
    }

    /// Draws a frame; false when there is no terminal any more to draw on.
    pub fn draw(&mut self, paint: impl FnOnce(Rect, &mut Buffer)) -> io::Result<bool> {
        if lock(&TAKEN).is_none() {
            return Err(io::Error::other("the screen was given back after a panic"));
        }
        let Ok(size) = termios::tcgetwinsize(stdio::stdout()) else { return Ok(false) };
        // A terminal that does not know its size has the one terminals have always had.
        let known = |cells: u16, usual: u16| if cells == 0 { usual } else { cells };
        let area = Rect::new(0, 0, known(size.ws_col, 80), known(size.ws_row, 24));
        let mut next = Buffer::empty(area);
        paint(area, &mut next);
        let is_whole = self.repaint <= Instant::now();
        let before = self.shown.as_ref().filter(|shown| shown.area == area && !is_whole);
        match self.frames.try_send(frame(before, &next)?) {
            Ok(()) => {
                self.shown = Some(next);
                if is_whole {
                    self.repaint = Instant::now() + REPAINT;
                }
                Ok(true)
            }
            Err(TrySendError::Full(_)) => Ok(true),
            Err(TrySendError::Disconnected(_)) => Ok(false),
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        give_back();
    }
}

/// The bytes that turn one picture into the next, or draw it from nothing.
pub(super) fn frame(before: Option<&Buffer>, next: &Buffer) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    queue!(bytes, BeginSynchronizedUpdate)?;
    let mut backend = CrosstermBackend::new(&mut bytes);
    match before {
        Some(before) => backend.draw(before.diff_iter(next))?,
        None => {
            backend.clear()?;
            backend.draw(Buffer::empty(next.area).diff_iter(next))?;
        }
    }
    queue!(bytes, EndSynchronizedUpdate)?;
    Ok(bytes)
}

fn give_back_on_panic() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            give_back();
            report(panic);
        }));
    });
}

/// Gives the terminal back, at the first call only.
fn give_back() {
    let Some(Taken { settings, terminal, stderr_capture }) = lock(&TAKEN).take() else { return };
    // A terminal that takes nothing in cannot be told to leave the screen either.
    if frames_have_stopped() {
        let mut out = stdout();
        let _ = queue!(out, EndSynchronizedUpdate, ResetColor, LeaveAlternateScreen, Show);
        let _ = out.flush();
    }
    let _ = termios::tcsetattr(&terminal, OptionalActions::Now, &settings);
    if let Some(stderr_capture) = stderr_capture {
        stderr_capture.release();
    }
}

/// Waits until no frame is being written, for a bounded time, and lets no more through.
fn frames_have_stopped() -> bool {
    let end = Instant::now() + PATIENCE;
    while Instant::now() < end {
        if let Ok(mut closed) = CLOSED.try_lock() {
            *closed = true;
            return true;
        }
        thread::sleep(Duration::from_millis(5));
    }
    false
}

#[cfg(test)]
mod tests {
    use std::num::NonZero;

    use ratatui::style::{Color, Style};

    use super::*;

    fn picture(width: u16, height: u16, words: &[(u16, u16, &str)]) -> Buffer {
        let mut buffer = Buffer::empty(Rect::new(0, 0, width, height));
        for (x, y, words) in words {
            buffer.set_string(*x, *y, words, Style::new().fg(Color::Indexed(32)));
        }
        buffer
    }

    fn terminal() -> vt100::Parser {
        let cells = |count| NonZero::new(count).unwrap();
        vt100::Parser::new(cells(3), cells(12), 0)
    }

    fn rows(terminal: &vt100::Parser) -> Vec<String> {
        terminal.screen().rows(0, 12).map(|row| row.trim_end().to_owned()).collect()
    }

    #[test]
    fn a_frame_turns_what_is_shown_into_what_should_be() {
        let mut terminal = terminal();
        let first = picture(12, 3, &[(0, 0, "t 1.00 s"), (3, 2, "k 0.9")]);
        terminal.process(&frame(None, &first).unwrap());
        assert_eq!(rows(&terminal), ["t 1.00 s", "", "   k 0.9"]);
        let second = picture(12, 3, &[(0, 0, "t 2.00 s"), (3, 1, "e ⣿")]);
        terminal.process(&frame(Some(&first), &second).unwrap());
        assert_eq!(rows(&terminal), ["t 2.00 s", "   e ⣿", ""]);
        let nothing = String::from_utf8(frame(Some(&second), &second).unwrap()).unwrap();
        assert!(!nothing.contains('s'), "what stays is not sent again: {nothing:?}");
    }

    #[test]
    fn a_whole_frame_covers_what_others_have_written() {
        let mut terminal = terminal();
        let shown = picture(12, 3, &[(0, 0, "t 1.00 s")]);
        terminal.process(&frame(None, &shown).unwrap());
        terminal.process(b"\nmtj: ignoring a state sample\n\n\n");
        assert_ne!(rows(&terminal), ["t 1.00 s", "", ""]);
        terminal.process(&frame(None, &shown).unwrap());
        assert_eq!(rows(&terminal), ["t 1.00 s", "", ""]);
    }
}
