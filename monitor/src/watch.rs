//! The live text view: one line a second.

use std::{
    io::{self, Write},
    time::{Duration, Instant},
};

use mtj_protocol::{
    bus::{Bus, BusError},
    port::MonitorPort,
};
use tokio::time::{MissedTickBehavior, interval};

use crate::view::View;

/// How often streams are emptied; far more often than they fill.
const DRAIN: Duration = Duration::from_millis(5);
/// How long a plant may be quiet before it counts as silent.
const SILENT: Duration = Duration::from_secs(1);

/// Prints what happens in a session, one line a second, as long as `proceed` says so.
pub async fn watch(
    bus: &impl Bus,
    out: &mut impl Write,
    proceed: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    let mut port = MonitorPort::open(bus)?;
    let mut view = View::default();
    let mut tick = interval(DRAIN);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut next_line = Instant::now() + Duration::from_secs(1);
    while proceed() {
        tick.tick().await;
        port.drain(|message| view.hear(message))?;
        if Instant::now() >= next_line {
            next_line += Duration::from_secs(1);
            let line = match view.silence() {
                None => "waiting for a plant".to_owned(),
                Some(silence) if silence > SILENT => {
                    format!("the plant has been silent for {:.0} s", silence.as_secs_f64())
                }
                Some(_) => view.line(),
            };
            if print(out, &line).is_err() {
                return Ok(()); // Nobody reads any more.
            }
        }
    }
    Ok(())
}

fn print(out: &mut impl Write, line: &str) -> io::Result<()> {
    writeln!(out, "{line}")?;
    out.flush()
}
