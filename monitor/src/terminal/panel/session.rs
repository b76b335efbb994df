//! Commands, roles and changes of the session.

use std::time::Duration;

use mtj_protocol::sample::{Phase, text_of};
use ratatui::{
    buffer::Buffer,
    layout::{Constraint, Layout, Rect},
    text::{Line, Span},
};

use super::{Picture, render_lines, wrap};
use crate::{
    overview::{Alarm, RoleStatus},
    terminal::palette::Tone,
};

/// A role without a message for this long has an empty indicator, also without an alarm.
const QUIET: Duration = Duration::from_millis(2500);

/// The panels of commands, roles and changes, one below the other.
pub(super) fn render(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let counts = counts(picture, area.width);
    // On a high screen the host has a line of its own.
    let lines = if area.height >= 12 { 2 } else { 1 };
    let roles = roles(picture, area.width, lines);
    let [commands, statuses, changes] = Layout::vertical([
        Constraint::Length(1 + counts.len() as u16),
        Constraint::Length(1 + roles.len() as u16),
        Constraint::Fill(1),
    ])
    .areas(area);
    let sent = picture.view.overview.status.map_or(0, |status| status.sent);
    let sent = Line::from(picture.styled(format!("{sent} sent"), Tone::Faint));
    render_lines(counts, picture.rule("Commands", sent, commands, buf), buf);
    render_lines(roles, picture.rule("Roles", Line::default(), statuses, buf), buf);
    if changes.height >= 2 {
        let area = picture.rule("Changes", Line::default(), changes, buf);
        render_lines(self::changes(picture, area.width), area, buf);
    }
}

/// How many commands were lost, late or rejected, and the counts of other incidents.
pub(super) fn counts<'a>(picture: &Picture, width: u16) -> Vec<Line<'a>> {
    let status = picture.view.overview.status.unwrap_or_default();
    let counts = [
        ("lost", status.lost),
        ("late", status.late),
        ("rejected", status.rejected),
        ("misses", status.deadline_misses),
        ("too old", status.too_old),
        ("stalls", status.stalls),
        ("timeouts", status.timeouts),
        ("takeovers", status.takeovers),
    ];
    let piece = |(name, count): (&str, u64)| {
        let tone = if count > 0 { Tone::Bad } else { Tone::Ok };
        vec![
            picture.styled(format!("{name} "), Tone::Faint),
            picture.styled(count.to_string(), tone),
        ]
    };
    // Most sessions have none of these.
    let is_rare = |name: &str| ["too old", "stalls", "timeouts", "takeovers"].contains(&name);
    let is_shown = |(name, count): &(&str, u64)| !is_rare(name) || *count > 0;
    wrap(counts.into_iter().filter(is_shown).map(piece).collect(), width)
}

/// Plant and controller, each with its indicator.
pub(super) fn indicators<'a>(picture: &Picture) -> Line<'a> {
    let mut spans = Vec::new();
    for (name, role, is_silent) in statuses(picture) {
        spans.extend([indicator(picture, role, is_silent), Span::raw(format!(" {name} "))]);
    }
    Line::from(spans)
}

/// Plant and controller, each with what is known of it.
fn roles<'a>(picture: &Picture, width: u16, most: usize) -> Vec<Line<'a>> {
    let mut lines = Vec::new();
    for (name, role, is_silent) in statuses(picture) {
        let mut pieces =
            vec![vec![indicator(picture, role, is_silent), Span::raw(format!(" {name:<10}"))]];
        match (role.silence(), role.age()) {
            (Some(silence), _) if is_silent => {
                let words = format!("silent {:.1} s", silence.as_secs_f64());
                pieces.push(vec![picture.styled(words, Tone::Bad)]);
            }
            (Some(silence), Some(age)) => {
                pieces.push(vec![Span::raw(elapsed(age))]);
                let heard = format!("heard {:.1} s ago", silence.as_secs_f64());
                pieces.push(vec![picture.styled(heard, Tone::Faint)]);
            }
            _ => pieces.push(vec![picture.styled("not heard yet", Tone::Faint)]),
        }
        if let Some(presence) = &role.presence {
            let host = text_of(&presence.host);
            pieces.push(vec![picture.styled(format!("{host} {}", presence.process), Tone::Faint)]);
        }
        let others = picture.live.standing_by();
        if name == "controller" && others > 0 {
            pieces.push(vec![picture.styled(format!("{others} standing by"), Tone::Faint)]);
        }
        lines.extend(wrap(pieces, width).into_iter().take(most));
    }
    lines
}

fn statuses<'a>(picture: &'a Picture) -> [(&'static str, &'a RoleStatus, bool); 2] {
    let alarm = picture.live.alarm();
    let is_over = picture.live.phase() == Some(Phase::Finished);
    let is_quiet =
        |role: &RoleStatus| !is_over && role.silence().is_some_and(|silence| silence > QUIET);
    let (plant, controller) = (picture.live.plant(), picture.live.controller());
    let plant_is_silent = matches!(alarm, Some(Alarm::PlantSilent(_)));
    let controller_is_silent = matches!(alarm, Some(Alarm::ControllerSilent(_)));
    [
        ("plant", plant, plant_is_silent || is_quiet(plant)),
        ("controller", controller, controller_is_silent || is_quiet(controller)),
    ]
}

fn indicator<'a>(picture: &Picture, role: &RoleStatus, is_silent: bool) -> Span<'a> {
    match role.last_heard {
        None => picture.styled("·", Tone::Faint),
        Some(_) if is_silent => picture.styled("○", Tone::Bad),
        Some(_) => picture.styled("●", Tone::Ok),
    }
}

/// The changes of the run, the newest first; the end of the list says what this monitor missed.
fn changes<'a>(picture: &Picture, width: u16) -> Vec<Line<'a>> {
    let overview = &picture.view.overview;
    let entry = |time_ns: u64, words: &str, tone| {
        let time = format!("{:.1} ", time_ns as f64 * 1e-9);
        let lines = break_words(words, usize::from(width).saturating_sub(time.len()));
        let indent = " ".repeat(time.len());
        let starts = std::iter::once(time).chain(std::iter::repeat(indent));
        let lines: Vec<_> = starts.zip(lines).collect();
        lines.into_iter().map(move |(start, line)| {
            Line::from(vec![picture.styled(start, Tone::Faint), picture.styled(line, tone)])
        })
    };
    let mut lines = Vec::new();
    for change in overview.changes.iter().rev() {
        lines.extend(match change.outcome() {
            Ok(()) => entry(change.header.time_ns, &change.words(), Tone::Change),
            Err(reason) => entry(change.header.time_ns, &format!("refused: {reason}"), Tone::Bad),
        });
    }
    match overview.joined() {
        Some(joined) => lines.extend(entry(joined.time_ns, &joined.words(), Tone::Faint)),
        None if lines.is_empty() => {
            lines.push(picture.styled("none in this run", Tone::Faint).into());
        }
        None => {}
    }
    lines
}

/// Breaks a text into lines of at most `width` characters: at a blank or, so that the value of a
/// long `key=value` stays in one piece, after the last dot or equals sign that fits.
fn break_words(words: &str, width: usize) -> Vec<String> {
    let mut rest: Vec<char> = words.chars().collect();
    let mut lines = Vec::new();
    while width > 0 && rest.len() > width {
        let last = |is_end: fn(char) -> bool| rest[..width].iter().rposition(|c| is_end(*c));
        let blank = if rest[width] == ' ' { Some(width - 1) } else { last(|c| c == ' ') };
        let end = blank.or_else(|| last(|c| c == '=' || c == '.')).map_or(width, |end| end + 1);
        let line: String = rest.drain(..end).collect();
        lines.push(line.trim_end().to_owned());
        let blanks = rest.iter().take_while(|c| **c == ' ').count();
        rest.drain(..blanks);
    }
    lines.push(rest.into_iter().collect());
    lines
}

fn elapsed(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{}:{:02}", seconds / 60, seconds % 60),
        _ => format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_broken_at_blanks_and_before_a_value() {
        for (words, width, lines) in [
            ("law.kind=tj", 20, &["law.kind=tj"][..]),
            ("link.torque.latency=5ms", 20, &["link.torque.latency=", "5ms"]),
            ("link.torque.latency=5ms", 10, &["link.", "torque.", "latency=", "5ms"]),
            ("law.kind=tj, law.kp=3", 14, &["law.kind=tj,", "law.kp=3"]),
            ("refused: there is no law", 16, &["refused: there", "is no law"]),
            ("12345678", 3, &["123", "456", "78"]),
            ("anything", 0, &["anything"]),
        ] {
            assert_eq!(break_words(words, width), lines, "{words} in {width}");
        }
    }
}
