//! What is on the screen, panel by panel.
//!
//! ```text
//! bars     title, settings, banner, keys
//! arm      the arm at scale, its desired path and the trail of its tip
//! chart    tracking error and the law's primary signal over time
//! torque   torques with their limits; the law's echo and signals on the task axes
//! timing   round trip, residence and jitter
//! session  commands, roles, changes
//! ```

mod arm;
mod bars;
mod chart;
mod session;
mod timing;
mod torque;

use ratatui::{
    buffer::Buffer,
    layout::{Constraint, Layout, Rect},
    text::{Line, Span},
    widgets::Widget,
};

use super::{
    log_layer::LogLine,
    palette::{Palette, Tone},
    view::View,
};
use crate::overview::Overview;

/// The smallest screen that holds the essentials.
const SMALLEST: (u16, u16) = (60, 16);
/// The smallest screen that holds everything.
const ROOMY: (u16, u16) = (80, 22);

/// The content of one frame.
pub(super) struct Picture<'a> {
    /// What is drawn: the current view, or the one that the user holds.
    pub view: &'a View,
    /// What is known now: alarms and roles are never held.
    pub live: &'a Overview,
    /// Whether the user holds the view.
    pub is_held: bool,
    /// The time span of the charts, s.
    pub window: f64,
    /// Session and bus.
    pub session: &'a str,
    /// The newest log line, if it is recent.
    pub log_line: Option<LogLine>,
    /// Whether to show what the keys do.
    pub shows_help: bool,
    pub palette: Palette,
}

impl Picture<'_> {
    /// Draws the whole screen.
    pub(super) fn render(&self, area: Rect, buf: &mut Buffer) {
        if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
            return bars::too_small(self, area, buf);
        }
        let alarm = self.live.alarm();
        let [title, facts, banner, body, keys] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Length(u16::from(alarm.is_some())),
            Constraint::Fill(1),
            Constraint::Length(1),
        ])
        .areas(area);
        bars::title(self, title, buf);
        bars::facts(self, facts, buf);
        if let Some(alarm) = alarm {
            bars::banner(self, alarm, banner, buf);
        }
        let is_roomy = area.width >= ROOMY.0 && area.height >= ROOMY.1;
        if self.shows_help {
            bars::help(self, body, buf);
        } else if is_roomy {
            self.roomy(body, buf);
        } else {
            self.compact(body, buf);
        }
        bars::keys(self, is_roomy && !self.shows_help, keys, buf);
    }

    fn roomy(&self, area: Rect, buf: &mut Buffer) {
        let joints = self.joints();
        // Numbers need their rows; drawings get most of the rest.
        let needed = 6 + joints.max(3);
        let numbers = needed.max(area.height * 2 / 5).min(area.height.saturating_sub(10));
        let [drawings, numbers] =
            Layout::vertical([Constraint::Fill(1), Constraint::Length(numbers)]).areas(area);
        // A character is twice as high as it is wide.
        let arm = (2 * drawings.height).min(area.width * 2 / 5);
        let [left, right] = Layout::horizontal([Constraint::Length(arm), Constraint::Fill(1)])
            .spacing(1)
            .areas(drawings);
        let [error, signal] =
            Layout::vertical([Constraint::Fill(3), Constraint::Fill(2)]).areas(right);
        arm::render(self, left, buf);
        chart::error(self, error, buf);
        chart::signal(self, signal, buf);

        let columns: [Rect; 3] =
            Layout::horizontal([Constraint::Fill(1); 3]).spacing(1).areas(numbers);
        let [torques, task] =
            Layout::vertical([Constraint::Length(1 + joints), Constraint::Fill(1)])
                .areas(columns[0]);
        torque::torques(self, torques, buf);
        torque::task(self, task, buf);
        timing::render(self, columns[1], buf);
        session::render(self, columns[2], buf);
    }

    fn compact(&self, area: Rect, buf: &mut Buffer) {
        let numbers = if area.height >= 16 { 7 } else { 6 };
        let [drawings, numbers] =
            Layout::vertical([Constraint::Fill(1), Constraint::Length(numbers)]).areas(area);
        let arm = (2 * drawings.height).min(area.width * 2 / 5);
        let [left, right] = Layout::horizontal([Constraint::Length(arm), Constraint::Fill(1)])
            .spacing(1)
            .areas(drawings);
        arm::render(self, left, buf);
        chart::error(self, right, buf);
        let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)])
            .spacing(1)
            .areas(numbers);
        let joints = self.joints().min(left.height - 2);
        let [torques, task] =
            Layout::vertical([Constraint::Length(1 + joints), Constraint::Fill(1)]).areas(left);
        torque::torques(self, torques, buf);
        torque::axes(self, task, buf);
        timing::brief(self, right, buf);
    }

    fn joints(&self) -> u16 {
        self.view.overview.header().map_or(2, |header| header.joints as u16)
    }

    fn styled<'a>(&self, words: impl Into<std::borrow::Cow<'a, str>>, tone: Tone) -> Span<'a> {
        Span::styled(words, self.palette.style(tone))
    }

    /// Draws a panel's first line: its title, a rule, and `right` at the right end. Returns the
    /// rest of the area.
    fn rule(&self, title: &str, right: Line, area: Rect, buf: &mut Buffer) -> Rect {
        let [line, rest] =
            Layout::vertical([Constraint::Length(1), Constraint::Fill(1)]).areas(area);
        if line.is_empty() {
            return rest;
        }
        self.styled("─".repeat(line.width.into()), Tone::Faint).render(line, buf);
        Line::from(vec![self.styled(title, Tone::Strong), Span::raw(" ")]).render(line, buf);
        let width = right.width() as u16;
        let free = line.width.saturating_sub(title.chars().count() as u16 + 2);
        if 0 < width && width < free {
            let at = Rect { x: line.right() - width - 1, width: width + 1, ..line };
            Line::from(Span::raw(" ")).render(at, buf);
            right.render(Rect { x: at.x + 1, width, ..at }, buf);
        }
        rest
    }
}

/// Draws lines from the top of an area, as many as fit.
fn render_lines<'a>(lines: impl IntoIterator<Item = Line<'a>>, area: Rect, buf: &mut Buffer) {
    for (row, line) in area.rows().zip(lines) {
        line.render(row, buf);
    }
}

/// Puts pieces one after another into as many lines as they need.
fn wrap<'a>(pieces: Vec<Vec<Span<'a>>>, width: u16) -> Vec<Line<'a>> {
    let mut lines: Vec<Line> = Vec::new();
    for piece in pieces {
        let piece = Line::from(piece);
        match lines.last_mut() {
            Some(line) if line.width() + 2 + piece.width() <= width.into() => {
                line.push_span(Span::raw("  "));
                line.spans.extend(piece.spans);
            }
            _ => lines.push(piece),
        }
    }
    lines
}

/// A number with three significant digits, in at most six characters.
fn three_digits(value: f64) -> String {
    match value.abs() {
        magnitude if magnitude < 9.995 => format!("{value:.2}"),
        magnitude if magnitude < 99.95 => format!("{value:.1}"),
        magnitude if magnitude < 99_999.5 => format!("{value:.0}"),
        _ => format!("{value:.0e}"),
    }
}

#[cfg(test)]
mod tests;
