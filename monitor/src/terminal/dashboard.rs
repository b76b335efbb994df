//! The terminal dashboard: a sink that draws what it gets, and reacts to keys.

use std::{
    fmt, io,
    time::{Duration, Instant},
};

use mtj_protocol::port::Message;

use super::{
    error::TerminalError,
    keyboard::{Decoder, Key},
    log_layer,
    palette::Palette,
    panel::Picture,
    screen::Screen,
    view::View,
};
use crate::{error::MonitorError, monitor::Sink};

/// How often to draw.
const PERIOD: Duration = Duration::from_millis(100);
/// The time spans that the charts can show, s.
const WINDOWS: [f64; 7] = [2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0];
/// The index of the time span at the start: 20 s.
const FIRST_WINDOW: usize = 3;
/// How long a log line is shown.
const LOG_LINE: Duration = Duration::from_secs(15);

/// Shows a session on a terminal.
pub struct Dashboard {
    screen: Screen,
    decoder: Decoder,
    palette: Palette,
    session: String,
    view: View,
    /// The view at the time when the user stopped it.
    held: Option<Box<View>>,
    window: usize,
    shows_help: bool,
    next: Instant,
}

impl fmt::Debug for Dashboard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Dashboard").field("session", &self.session).finish_non_exhaustive()
    }
}

impl Dashboard {
    /// Opens the dashboard on this terminal; `session` names session and bus.
    pub fn open(session: String) -> io::Result<Self> {
        Ok(Self {
            screen: Screen::open()?,
            decoder: Decoder::default(),
            palette: Palette::from_environment(),
            session,
            view: View::default(),
            held: None,
            window: FIRST_WINDOW,
            shows_help: false,
            next: Instant::now(),
        })
    }

    /// Reacts to a key; false if the dashboard should close.
    fn press(&mut self, key: Key) -> bool {
        match key {
            Key::Quit => return false,
            Key::Hold => {
                self.held = match self.held.take() {
                    Some(_) => None,
                    None => Some(Box::new(self.view.clone())),
                };
            }
            Key::Longer => self.window = (self.window + 1).min(WINDOWS.len() - 1),
            Key::Shorter => self.window = self.window.saturating_sub(1),
            Key::Help => self.shows_help = !self.shows_help,
        }
        // Draw at once, so that the user sees the effect.
        self.next = Instant::now();
        true
    }

    fn draw(&mut self) -> io::Result<bool> {
        let picture = Picture {
            view: self.held.as_deref().unwrap_or(&self.view),
            live: &self.view.overview,
            is_held: self.held.is_some(),
            window: WINDOWS[self.window],
            session: &self.session,
            log_line: log_layer::newest(LOG_LINE),
            shows_help: self.shows_help,
            palette: self.palette,
        };
        self.screen.draw(|area, buffer| picture.render(area, buffer))
    }
}

impl Sink for Dashboard {
    fn handle(&mut self, message: &Message) {
        self.view.handle(message);
    }

    fn refresh(&mut self) -> Result<bool, MonitorError> {
        let Some(bytes) = self.screen.read_keys() else { return Ok(false) };
        for key in self.decoder.keys(&bytes, Instant::now()) {
            if !self.press(key) {
                return Ok(false);
            }
        }
        if Instant::now() < self.next {
            return Ok(true);
        }
        self.next = Instant::now() + PERIOD;
        Ok(self.draw().map_err(TerminalError::Draw)?)
    }
}
