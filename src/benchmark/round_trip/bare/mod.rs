//! The transports without us: one process sends a state, the other sends a torque back as soon as
//! it has it.
//!
//! Each is used the way its own examples measure a round trip.

#[cfg(feature = "iceoryx2")]
mod iceoryx2;
#[cfg(feature = "zenoh")]
mod zenoh;

use std::{
    env,
    process::{Child, Command, Stdio},
};

use mtj_model::scenario::{BusKind, Wait};
use mtj_plant::durations::Durations;
use mtj_protocol::realtime::Realtime;

use super::{Effort, Way, free_endpoint};
use crate::failure::Failure;

/// Round trips are counted from here on: the first ones find everything cold.
#[cfg(any(feature = "iceoryx2", feature = "zenoh"))]
const WARM_UP: u64 = 1000;

/// All round trips of one round.
pub(crate) fn measure(way: Way, effort: &Effort) -> Result<Durations, Failure> {
    let place = match way.bus {
        BusKind::Zenoh => free_endpoint()?,
        _ => format!("{}", std::process::id()),
    };
    // On a thread of its own, so that pinning it pins nothing else.
    std::thread::scope(|scope| {
        let measuring = scope.spawn(|| {
            let realtime = Realtime::from(&effort.realtime.plant());
            realtime.before_joining();
            let _echo = Echo::start(way, &place, effort)?;
            realtime.before_the_loop()?;
            match way.bus {
                #[cfg(feature = "iceoryx2")]
                BusKind::Iceoryx2 => iceoryx2::ping(&place, way, effort.samples),
                #[cfg(feature = "zenoh")]
                BusKind::Zenoh => zenoh::ping(&place, effort.samples),
                kind => Err(unknown(kind)),
            }
        });
        measuring.join().unwrap_or_else(|_| Err(Failure::other("the measuring thread panicked")))
    })
}

/// The other process: answers as long as `proceed` says so.
pub(crate) fn echo(
    bus: BusKind,
    wait: Wait,
    place: &str,
    proceed: &dyn Fn() -> bool,
) -> Result<(), Failure> {
    match bus {
        #[cfg(feature = "iceoryx2")]
        BusKind::Iceoryx2 => iceoryx2::pong(place, wait, proceed),
        #[cfg(feature = "zenoh")]
        BusKind::Zenoh => zenoh::pong(place, proceed),
        kind => {
            let _ = (wait, place, proceed);
            Err(unknown(kind))
        }
    }
}

fn unknown(kind: BusKind) -> Failure {
    Failure::bad_input(format!("--bus {}: there is no round trip between processes", kind.name()))
}

/// The command of the echo's process, which only this program gives.
pub const ECHO: &str = "echo";

/// The echo's process, which ends with this.
struct Echo(Child);

impl Echo {
    fn start(way: Way, place: &str, effort: &Effort) -> Result<Self, Failure> {
        let child = Command::new(env::current_exe()?)
            .args([ECHO, "--bus", way.bus.name(), "--wait", way.wait.name(), "--place", place])
            .args(effort.realtime.controller().arguments())
            .stdin(Stdio::piped())
            .spawn()?;
        Ok(Self(child))
    }
}

impl Drop for Echo {
    fn drop(&mut self) {
        drop(self.0.stdin.take());
        // It ends by itself; if not, nothing is left to wait for.
        let _ = self.0.wait();
    }
}
