//! The terminal: set up for a dashboard, and restored afterwards.

use std::{
    io::{self, Write, stdout},
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

use super::{keyboard::Keyboard, log_layer};

/// How often the whole screen is drawn again, in case something else has written to the terminal.
const REPAINT: Duration = Duration::from_secs(3);
/// How long the terminal may take to accept the last frame before it is restored.
const TIMEOUT: Duration = Duration::from_secs(1);

/// A full screen to draw on.
///
/// A thread of its own writes frames to the terminal. While it writes one, no other is accepted: a
/// slow line drops frames, not samples.
pub(super) struct Screen {
    keyboard: Keyboard,
    frames: SyncSender<Vec<u8>>,
    shown: Option<Buffer>,
    repaint: Instant,
}

/// The terminal's settings before the dashboard.
struct SavedTerminal {
    settings: Termios,
    terminal: Keyboard,
}

/// The saved terminal while a dashboard is open; static, because a panic on any thread restores it.
static SAVED: Mutex<Option<SavedTerminal>> = Mutex::new(None);
/// Locked while a frame is written; true when no more frames may be written.
static CLOSED: Mutex<bool> = Mutex::new(false);

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Screen {
    /// Saves the terminal's settings and switches to a full screen.
    pub(super) fn open() -> io::Result<Self> {
        let terminal = Keyboard::open()?;
        let settings = termios::tcgetattr(&terminal)?;
        restore_on_panic();
        *lock(&CLOSED) = false;
        let mut raw = settings.clone();
        raw.make_raw();
        *lock(&SAVED) = Some(SavedTerminal { settings, terminal: Keyboard::open()? });
        log_layer::open();
        let (frames, arriving) = mpsc::sync_channel::<Vec<u8>>(1);
        let screen = Self { keyboard: terminal, frames, shown: None, repaint: Instant::now() };
        // From here on, dropping the screen restores the terminal.
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

    /// The bytes of the keys since the last call; `None` when the terminal is gone.
    pub(super) fn read_keys(&self) -> Option<Vec<u8>> {
        self.keyboard.read()
    }

    /// Draws a frame; false when the terminal is gone.
    pub(super) fn draw(&mut self, render: impl FnOnce(Rect, &mut Buffer)) -> io::Result<bool> {
        if lock(&SAVED).is_none() {
            return Err(io::Error::other("the screen was closed after a panic"));
        }
        let Ok(size) = termios::tcgetwinsize(stdio::stdout()) else { return Ok(false) };
        // A terminal that does not know its size gets the traditional one.
        let known = |cells: u16, usual: u16| if cells == 0 { usual } else { cells };
        let area = Rect::new(0, 0, known(size.ws_col, 80), known(size.ws_row, 24));
        let mut next = Buffer::empty(area);
        render(area, &mut next);
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
        restore();
    }
}

/// The bytes that turn one screen content into the next, or draw all of it.
fn frame(before: Option<&Buffer>, next: &Buffer) -> io::Result<Vec<u8>> {
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

fn restore_on_panic() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            restore();
            report(panic);
        }));
    });
}

/// Restores the terminal; a second call does nothing.
fn restore() {
    let Some(SavedTerminal { settings, terminal }) = lock(&SAVED).take() else { return };
    // A terminal that accepts no frame accepts no other bytes either.
    if stop_frames() {
        let mut out = stdout();
        let _ = queue!(out, EndSynchronizedUpdate, ResetColor, LeaveAlternateScreen, Show);
        let _ = out.flush();
    }
    let _ = termios::tcsetattr(&terminal, OptionalActions::Now, &settings);
    log_layer::close();
}

/// Waits, not for long, until no frame is being written; then no more are written.
fn stop_frames() -> bool {
    let end = Instant::now() + TIMEOUT;
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
    fn a_frame_turns_one_content_into_the_next() {
        let mut terminal = terminal();
        let first = picture(12, 3, &[(0, 0, "t 1.00 s"), (3, 2, "k 0.9")]);
        terminal.process(&frame(None, &first).unwrap());
        assert_eq!(rows(&terminal), ["t 1.00 s", "", "   k 0.9"]);
        let second = picture(12, 3, &[(0, 0, "t 2.00 s"), (3, 1, "e ⣿")]);
        terminal.process(&frame(Some(&first), &second).unwrap());
        assert_eq!(rows(&terminal), ["t 2.00 s", "   e ⣿", ""]);
        let nothing = String::from_utf8(frame(Some(&second), &second).unwrap()).unwrap();
        assert!(!nothing.contains('s'), "unchanged cells are not sent again: {nothing:?}");
    }

    #[test]
    fn a_whole_frame_replaces_what_others_have_written() {
        let mut terminal = terminal();
        let shown = picture(12, 3, &[(0, 0, "t 1.00 s")]);
        terminal.process(&frame(None, &shown).unwrap());
        terminal.process(b"\nmtj: ignoring a state sample\n\n\n");
        assert_ne!(rows(&terminal), ["t 1.00 s", "", ""]);
        terminal.process(&frame(None, &shown).unwrap());
        assert_eq!(rows(&terminal), ["t 1.00 s", "", ""]);
    }
}
