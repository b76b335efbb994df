//! Many sessions at once: `mtj monitor --session '*'`.
//!
//! ```text
//! pattern  which sessions to show
//! session  what is known of one session
//! table    one line for each session
//! ```

mod pattern;
mod session;
mod table;

use std::{
    collections::BTreeMap,
    io::Write,
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::is_name;
use mtj_protocol::bus::Shared;

pub use self::pattern::{Pattern, PatternError};
use self::{session::SessionMonitor, table::Table};
use crate::error::MonitorError;

/// How often streams are emptied. The table is shown once a second, so this may be slow; a stream
/// holds four thousand samples.
const PERIOD: Duration = Duration::from_millis(20);
/// How often to look for new and for ended sessions.
const DISCOVERY: Duration = Duration::from_millis(250);
/// How often the table is shown.
const REFRESH: Duration = Duration::from_secs(1);
/// How long a session without members stays in the table.
const GONE: Duration = Duration::from_secs(5);

/// Shows all sessions of a bus that match a pattern on `out`, until `proceed` returns false or the
/// reader of `out` has gone.
pub fn run<B: Shared>(
    bus: &B,
    pattern: &Pattern,
    out: impl Write,
    proceed: &dyn Fn() -> bool,
) -> Result<(), MonitorError> {
    let mut names = bus.sessions()?;
    let mut sessions = BTreeMap::<String, SessionMonitor<B>>::new();
    let mut table = Table::new(out);
    let (mut discovery, mut refresh) = (Instant::now(), Instant::now() + REFRESH);
    while proceed() {
        let now = Instant::now();
        if now >= discovery {
            discovery = now + DISCOVERY;
            let mut present = names.names()?;
            // On a bus anybody may announce a session of any name.
            present.retain(|name| is_name(name) && pattern.matches(name));
            for name in &present {
                sessions.entry(name.clone()).or_default().join(bus, name);
            }
            for (name, session) in &mut sessions {
                session.set_present(present.contains(name));
            }
            sessions.retain(|_, session| session.absence().is_none_or(|absence| absence < GONE));
        }
        for session in sessions.values_mut() {
            session.drain();
        }
        if now >= refresh {
            refresh = now + REFRESH;
            let rows: Vec<_> =
                sessions.iter_mut().map(|(name, session)| session.row(name)).collect();
            if !table.show(&rows, pattern) {
                return Ok(());
            }
        }
        thread::sleep(PERIOD);
    }
    Ok(())
}
