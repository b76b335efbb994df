//! The table of a fleet: one line for each session.

use std::io::{IsTerminal, Write, stdout};

use rustix::{stdio, termios};

use super::Pattern;
use crate::durations::Spread;

/// One line of the table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SessionRow {
    pub session: String,
    pub phase: &'static str,
    /// The run's time, s.
    pub time: f64,
    pub law: &'static str,
    /// Root mean square of the tracking error in the last second, m.
    pub error: Option<f64>,
    /// The law's primary signal with its mean over the last second.
    pub signal: Option<String>,
    /// Round trips of the last ten seconds.
    pub round_trip: Option<Spread>,
    /// Process and machine of the leading controller.
    pub leader: String,
    /// How many controllers stand by for the leader.
    pub standby: usize,
    /// The numbers of [`COUNTS`].
    pub counts: [u64; COUNTS.len()],
    pub alarm: Option<String>,
}

/// What is counted since the run began: by the plant, and by this monitor.
const COUNTS: [&str; 7] =
    ["lost", "too old", "late", "rejected", "timeouts", "takeovers", "missed here"];

/// The columns of text, which are aligned to the left; numbers are aligned to the right.
const TEXTS: [&str; 5] = ["session", "phase", "law", "leader", "alarm"];

const RED: &str = "\x1b[31m";
const PLAIN: &str = "\x1b[0m";

/// Shows tables: on a terminal each replaces the last one, elsewhere it follows.
pub(super) struct Table<W> {
    out: W,
    is_terminal: bool,
    is_coloured: bool,
    /// How many lines of the last table are above the cursor.
    shown: usize,
}

impl<W: Write> Table<W> {
    /// Writes to `out`; a new table replaces the last one if standard output is a terminal.
    pub(super) fn new(out: W) -> Self {
        let is_terminal = stdout().is_terminal();
        let no_color = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
        Self { out, is_terminal, is_coloured: is_terminal && !no_color, shown: 0 }
    }

    /// Shows the sessions; false if the reader of the output has gone.
    pub(super) fn show(&mut self, rows: &[SessionRow], pattern: &Pattern) -> bool {
        let text = self.text(rows, pattern, self.is_terminal.then(size));
        self.out.write_all(text.as_bytes()).and_then(|()| self.out.flush()).is_ok()
    }

    /// The bytes that show the sessions; on a terminal of a given size they replace the last table.
    fn text(
        &mut self,
        rows: &[SessionRow],
        pattern: &Pattern,
        size: Option<(usize, usize)>,
    ) -> String {
        let mut lines = lay_out(rows);
        if rows.is_empty() {
            lines = vec![format!("no session is called '{}' on this bus yet", pattern.as_str())];
        }
        let mut text = String::new();
        if let Some((columns, height)) = size {
            if lines.len() > height {
                let hidden = lines.len() - (height - 1);
                lines.truncate(height - 1);
                lines.push(format!("… and {hidden} more, for which this terminal is too low"));
            }
            if self.shown > 0 {
                text += &format!("\x1b[{}A\x1b[J", self.shown);
            }
            // A wrapped line would take the space of two.
            lines.iter_mut().for_each(|line| *line = line.chars().take(columns).collect());
            self.shown = lines.len();
        }
        // The first line is the heading.
        let alarms = [false].into_iter().chain(rows.iter().map(|row| row.alarm.is_some()));
        for (line, is_alarm) in lines.iter().zip(alarms) {
            match is_alarm && self.is_coloured {
                true => text += &format!("{RED}{line}{PLAIN}\n"),
                false => text += &format!("{line}\n"),
            }
        }
        text
    }
}

/// How many columns the terminal has, and how many lines without the one of the cursor.
fn size() -> (usize, usize) {
    let known = |cells: u16, usual: usize| if cells == 0 { usual } else { cells.into() };
    termios::tcgetwinsize(stdio::stdout()).map_or((80, 23), |size| {
        (known(size.ws_col, 80), known(size.ws_row, 24).saturating_sub(1).max(2))
    })
}

/// The heading and the rows, in columns.
fn lay_out(rows: &[SessionRow]) -> Vec<String> {
    let heading = ["session", "phase", "t/s", "law", "|e|/m", "signal", "p50/µs", "p99/µs"];
    let heading: Vec<&str> =
        heading.into_iter().chain(["leader", "standby"]).chain(COUNTS).chain(["alarm"]).collect();
    let mut lines = vec![heading.iter().map(|title| (*title).to_owned()).collect()];
    lines.extend(rows.iter().map(cells));
    let width = |column: usize| {
        lines.iter().map(|line: &Vec<String>| line[column].chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..heading.len()).map(width).collect();
    let line = |cells: &Vec<String>| {
        let columns = cells.iter().zip(&heading).zip(&widths);
        let aligned = columns.map(|((cell, title), width)| match TEXTS.contains(title) {
            true => format!("{cell:<width$}"),
            false => format!("{cell:>width$}"),
        });
        aligned.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    lines.iter().map(line).collect()
}

fn cells(row: &SessionRow) -> Vec<String> {
    let number = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    let trip = |of: fn(&Spread) -> f64| {
        number(row.round_trip.as_ref().map(|spread| format!("{:.1}", of(spread))))
    };
    let mut cells = vec![
        row.session.clone(),
        row.phase.to_owned(),
        format!("{:.1}", row.time),
        row.law.to_owned(),
        number(row.error.map(|error| format!("{error:.2e}"))),
        number(row.signal.clone()),
        trip(|spread| spread.p50),
        trip(|spread| spread.p99),
        row.leader.clone(),
        row.standby.to_string(),
    ];
    cells.extend(row.counts.iter().map(u64::to_string));
    cells.push(row.alarm.clone().unwrap_or_default());
    cells
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by it")]
mod tests {
    use std::num::NonZero;

    use super::*;

    fn row(session: &str, alarm: Option<&str>) -> SessionRow {
        let alarm = alarm.map(str::to_owned);
        SessionRow {
            session: session.to_owned(),
            phase: "running",
            law: "mtj",
            alarm,
            ..SessionRow::default()
        }
    }

    /// The rows of a terminal after some tables, each with the colour of its first letter.
    fn seen(tables: &[&[SessionRow]], size: (u16, u16)) -> Vec<(String, vt100::Color)> {
        let mut table = Table { out: Vec::new(), is_terminal: true, is_coloured: true, shown: 0 };
        let cells = |count| NonZero::new(count).unwrap();
        let mut terminal = vt100::Parser::new(cells(size.1), cells(size.0), 0);
        for rows in tables {
            let room = (size.0.into(), usize::from(size.1) - 1);
            let text = table.text(rows, &"*".parse().unwrap(), Some(room));
            terminal.process(text.replace('\n', "\r\n").as_bytes());
        }
        let screen = terminal.screen();
        let colour = |row: usize| screen.cell(row as u16, 0).map(vt100::Cell::fgcolor).unwrap();
        let rows = screen.rows(0, size.0).enumerate();
        rows.map(|(i, text)| (text.trim_end().to_owned(), colour(i))).collect()
    }

    #[test]
    fn a_table_replaces_the_last_one() {
        let both = [row("cell-1", None), row("cell-2", Some("the plant is waiting"))];
        let shown = seen(&[&[], &both, &both[..1]], (170, 8));
        assert!(
            shown[0].0.starts_with("session  phase ") && shown[0].0.ends_with("alarm"),
            "{shown:?}"
        );
        assert!(shown[1].0.starts_with("cell-1   running "), "{shown:?}");
        assert!(shown[2..].iter().all(|(text, _)| text.is_empty()), "{shown:?}");
    }

    #[test]
    fn only_a_session_with_an_alarm_is_red() {
        let shown = seen(&[&[row("a", None), row("b", Some("silent"))]], (170, 8));
        assert_eq!((shown[1].1, shown[2].1), (vt100::Color::Default, vt100::Color::Idx(1)));
        assert!(shown[2].0.ends_with("silent"), "{shown:?}");
    }

    #[test]
    fn a_small_terminal_says_how_many_sessions_it_hides() {
        let many: Vec<SessionRow> = (0..9).map(|i| row(&format!("cell-{i}"), None)).collect();
        let shown = seen(&[&many, &many], (40, 6));
        assert!(shown[0].0.starts_with("session"), "{shown:?}");
        assert!(shown[3].0.starts_with("cell-2"), "{shown:?}");
        assert!(shown[4].0.starts_with("… and 6 more"), "{shown:?}");
    }
}
