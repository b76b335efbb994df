//! Many sessions at once: `mtj monitor --session '*'`.
//!
//! ```text
//! pattern  which sessions
//! cell     what is known of one of them
//! table    a line for each
//! ```

mod cell;
mod pattern;
mod table;

use std::{
    collections::BTreeMap,
    io::Write,
    thread,
    time::{Duration, Instant},
};

use mtj_model::scenario::is_name;
use mtj_protocol::bus::{BusError, Shared};

pub use self::pattern::Pattern;
use self::{cell::Cell, table::Table};

/// How often streams are emptied. Tables are read once a second, so this may take its time; a stream holds
/// four thousand samples.
const PERIOD: Duration = Duration::from_millis(20);
/// How often to look for sessions that come and go.
const LOOK: Duration = Duration::from_millis(250);
/// How often the table is shown.
const SHOW: Duration = Duration::from_secs(1);
/// How long a session is still shown in which nobody takes part any more.
const FAREWELL: Duration = Duration::from_secs(5);

/// Shows all sessions of a bus that a pattern means, on `out`, as long as `proceed` says so and somebody
/// reads.
pub fn watch<B: Shared>(
    bus: &B,
    pattern: &Pattern,
    out: impl Write,
    proceed: &dyn Fn() -> bool,
) -> Result<(), BusError> {
    let mut sessions = bus.sessions()?;
    let mut cells = BTreeMap::<String, Cell<B>>::new();
    let mut table = Table::new(out);
    let (mut look, mut show) = (Instant::now(), Instant::now() + SHOW);
    while proceed() {
        let now = Instant::now();
        if now >= look {
            look = now + LOOK;
            let mut present = sessions.names()?;
            // Anybody may announce himself on a bus under any name.
            present.retain(|name| is_name(name) && pattern.matches(name));
            for name in &present {
                cells.entry(name.clone()).or_default().join(bus, name);
            }
            for (name, cell) in &mut cells {
                cell.is_there(present.contains(name));
            }
            cells.retain(|_, cell| cell.absence().is_none_or(|absence| absence < FAREWELL));
        }
        for cell in cells.values_mut() {
            cell.listen();
        }
        if now >= show {
            show = now + SHOW;
            let rows: Vec<_> = cells.iter_mut().map(|(name, cell)| cell.row(name)).collect();
            if !table.show(&rows, pattern) {
                return Ok(());
            }
        }
        thread::sleep(PERIOD);
    }
    Ok(())
}
