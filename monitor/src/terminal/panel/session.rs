//! Commands, roles and changes of the session.

use std::time::Duration;

use mtj_protocol::sample::text_of;
use ratatui::{
    buffer::Buffer,
    layout::{Constraint, Layout, Rect},
    text::{Line, Span},
};

use super::{Picture, render_lines, wrap};
use crate::{
    overview::{Alarm, Phase, RoleStatus},
    terminal::palette::Tone,
};

/// A role without a message for this long has an empty indicator, also without an alarm.
const QUIET: Duration = Duration::from_millis(2500);

/// The panels of commands, roles and changes, one below the other.
pub fn render(picture: &Picture, area: Rect, buf: &mut Buffer) {
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
        render_lines(self::changes(picture), area, buf);
    }
}

/// How many commands were lost, late or rejected, and the counts of other incidents.
pub fn counts<'a>(picture: &Picture, width: u16) -> Vec<Line<'a>> {
    let status = picture.view.overview.status.unwrap_or_default();
    let counts = [
        ("lost", status.lost),
        ("late", status.late),
        ("rejected", status.rejected),
        ("misses", status.deadline_misses),
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
    // Most sessions have no timeouts and takeovers.
    let is_shown =
        |(name, count): &(&str, u64)| !["timeouts", "takeovers"].contains(name) || *count > 0;
    wrap(counts.into_iter().filter(is_shown).map(piece).collect(), width)
}

/// Plant and controller, each with its indicator.
pub fn indicators<'a>(picture: &Picture) -> Line<'a> {
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

/// The newest first.
fn changes<'a>(picture: &Picture) -> Vec<Line<'a>> {
    let overview = &picture.view.overview;
    let lines = overview.changes.iter().rev().map(|change| {
        let time =
            picture.styled(format!("{:.1} ", change.header.time_ns as f64 * 1e-9), Tone::Faint);
        let words = match change.outcome() {
            Ok(()) => picture.styled(change.words(), Tone::Change),
            Err(reason) => picture.styled(format!("refused: {reason}"), Tone::Bad),
        };
        Line::from(vec![time, words])
    });
    let none = Line::from(picture.styled("none in this run", Tone::Faint));
    if overview.changes.is_empty() { vec![none] } else { lines.collect() }
}

fn elapsed(time: Duration) -> String {
    let seconds = time.as_secs();
    match seconds {
        0..60 => format!("{seconds} s"),
        60..3600 => format!("{}:{:02}", seconds / 60, seconds % 60),
        _ => format!("{}:{:02}:{:02}", seconds / 3600, seconds / 60 % 60, seconds % 60),
    }
}
