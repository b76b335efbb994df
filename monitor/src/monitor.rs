//! The loop of a monitor: hears everything that is said, and tells it to an audience.

use std::{thread, time::Duration};

use mtj_protocol::{
    bus::{Bus, BusError},
    port::{Message, MonitorPort},
};

/// How often streams are emptied; far more often than they fill.
const PERIOD: Duration = Duration::from_millis(5);

/// Where messages come from: a bus, or a recording.
pub trait Source {
    /// Hands over all that was said since the last call.
    fn drain(&mut self, hear: &mut dyn FnMut(Message)) -> Result<(), BusError>;
}

/// Who wants to know: a dashboard, a recorder, a line of text.
///
/// What takes long, like a disk or a network, belongs on a thread of its own: while one listener is
/// busy nobody hears anything.
pub trait Audience {
    /// Takes in one message.
    fn hear(&mut self, message: &Message);
    /// Called after each round of messages, some two hundred times a second; false if there is
    /// nobody any more to monitor for.
    fn refresh(&mut self) -> Result<bool, BusError> {
        Ok(true)
    }
}

/// The messages of a bus.
pub struct Live<'a, B> {
    bus: &'a B,
    port: MonitorPort,
}

impl<'a, B: Bus> Live<'a, B> {
    /// Joins a bus to listen.
    pub fn open(bus: &'a B) -> Result<Self, BusError> {
        Ok(Self { bus, port: MonitorPort::open(bus)? })
    }
}

impl<B: Bus> Source for Live<'_, B> {
    fn drain(&mut self, hear: &mut dyn FnMut(Message)) -> Result<(), BusError> {
        self.port.drain(self.bus, hear)
    }
}

/// Tells an audience what a source says, as long as `proceed` says so.
pub fn attend(
    source: &mut dyn Source,
    audience: &mut [Box<dyn Audience + '_>],
    proceed: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    while proceed() {
        source.drain(&mut |message| {
            for listener in audience.iter_mut() {
                listener.hear(&message);
            }
        })?;
        for listener in audience.iter_mut() {
            if !listener.refresh()? {
                return Ok(());
            }
        }
        thread::sleep(PERIOD);
    }
    Ok(())
}
