//! The terminal dashboard: an audience that draws what it hears, and listens to keys.

use std::{
    io,
    time::{Duration, Instant},
};

use mtj_protocol::{bus::BusError, port::Message};

use super::{
    keyboard::{Decoder, Key},
    palette::Palette,
    panel::Picture,
    screen::Screen,
    view::View,
};
use crate::monitor::Audience;

/// How often to draw.
const PERIOD: Duration = Duration::from_millis(100);
/// How much time the charts can show, s.
const WINDOWS: [f64; 7] = [2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0];
/// Where it begins: 20 s.
const USUAL: usize = 3;
/// How long a line from standard error is shown.
const ASIDE: Duration = Duration::from_secs(15);

/// Shows a session on a terminal.
pub struct Dashboard {
    screen: Screen,
    decoder: Decoder,
    palette: Palette,
    place: String,
    view: View,
    held: Option<Box<View>>,
    window: usize,
    is_helping: bool,
    next: Instant,
}

impl Dashboard {
    /// Takes over the terminal; `place` names session and bus.
    pub fn open(place: String) -> io::Result<Self> {
        Ok(Self {
            screen: Screen::open()?,
            decoder: Decoder::default(),
            palette: Palette::from_environment(),
            place,
            view: View::default(),
            held: None,
            window: USUAL,
            is_helping: false,
            next: Instant::now(),
        })
    }

    /// Whether to go on.
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
            Key::Help => self.is_helping = !self.is_helping,
        }
        // A key is answered at once.
        self.next = Instant::now();
        true
    }

    fn draw(&mut self) -> io::Result<bool> {
        let picture = Picture {
            view: self.held.as_deref().unwrap_or(&self.view),
            live: &self.view.overview,
            is_held: self.held.is_some(),
            window: WINDOWS[self.window],
            place: &self.place,
            aside: self.screen.said().newest(ASIDE),
            is_helping: self.is_helping,
            palette: self.palette,
        };
        self.screen.draw(|area, buffer| picture.paint(area, buffer))
    }
}

impl Audience for Dashboard {
    fn hear(&mut self, message: &Message) {
        self.view.hear(message);
    }

    fn refresh(&mut self) -> Result<bool, BusError> {
        let Some(bytes) = self.screen.typed() else { return Ok(false) };
        for key in self.decoder.keys(&bytes, Instant::now()) {
            if !self.press(key) {
                return Ok(false);
            }
        }
        if Instant::now() < self.next {
            return Ok(true);
        }
        self.next = Instant::now() + PERIOD;
        self.draw()
            .map_err(|error| BusError::Transport(format!("the terminal failed: {error}").into()))
    }
}
