//! The loop of a monitor: passes each message of a source to all sinks.

use std::{
    fmt, thread,
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::Bus,
    port::{Message, MonitorPort, Tolerance},
    stall,
};

use crate::error::MonitorError;

/// How often the source is emptied; far more often than its streams fill.
const PERIOD: Duration = Duration::from_millis(5);

/// Where messages come from: a bus, or a recording.
pub trait Source {
    /// Passes all messages since the last call to `handle`.
    fn drain(&mut self, handle: &mut dyn FnMut(Message)) -> Result<(), MonitorError>;
}

/// Where messages go: a dashboard, a recorder, lines of text.
///
/// All sinks share one thread. Slow work, like writing to a disk or a network, belongs on a thread
/// of its own.
pub trait Sink {
    /// Takes one message.
    fn handle(&mut self, message: &Message);
    /// Called after each round of messages, about 200 times a second; returns false when the
    /// monitor should end, as when the user quits a dashboard.
    fn refresh(&mut self) -> Result<bool, MonitorError> {
        Ok(true)
    }
}

/// The messages of a bus.
pub struct BusSource<'a, B> {
    bus: &'a B,
    port: MonitorPort,
    tolerance: Tolerance,
}

impl<B> fmt::Debug for BusSource<'_, B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BusSource").finish_non_exhaustive()
    }
}

impl<'a, B: Bus> BusSource<'a, B> {
    /// Joins a bus as a monitor.
    pub fn open(bus: &'a B) -> Result<Self, MonitorError> {
        Ok(Self { bus, port: MonitorPort::open(bus)?, tolerance: Tolerance::default() })
    }
}

impl<B: Bus> Source for BusSource<'_, B> {
    fn drain(&mut self, handle: &mut dyn FnMut(Message)) -> Result<(), MonitorError> {
        let drained = self.port.drain(self.bus, handle);
        self.tolerance.tolerate("read samples", drained);
        Ok(())
    }
}

/// Passes messages from a source to all sinks until `proceed` returns false or a sink ends the
/// monitor.
pub fn run(
    source: &mut dyn Source,
    sinks: &mut [Box<dyn Sink + '_>],
    proceed: &dyn Fn() -> bool,
) -> Result<(), MonitorError> {
    while proceed() {
        source.drain(&mut |message| {
            for sink in sinks.iter_mut() {
                sink.handle(&message);
            }
        })?;
        for sink in sinks.iter_mut() {
            if !sink.refresh()? {
                return Ok(());
            }
        }
        let until = Instant::now() + PERIOD;
        thread::sleep(PERIOD);
        if let Some(stall) = stall::stall(until, Instant::now()) {
            stall::tell("the monitor", stall, "it counts the samples that it missed");
        }
    }
    Ok(())
}
