//! Who takes part, and what became of commands and requests.

use std::time::Duration;

use mtj_protocol::sample::text_of;
use ratatui::{
    buffer::Buffer,
    layout::{Constraint, Layout, Rect},
    text::{Line, Span},
};

use super::{Picture, flow, stack};
use crate::{
    overview::{Alarm, Party, Phase},
    terminal::palette::Ink,
};

/// How long a role may be quiet before its lamp goes out, if there is no alarm before.
const QUIET: Duration = Duration::from_millis(2500);

/// Commands, roles and changes, one below the other.
pub fn paint(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let counts = counts(picture, area.width);
    // The machine has a line of its own where there are lines to spare.
    let lines = if area.height >= 12 { 2 } else { 1 };
    let roles = roles(picture, area.width, lines);
    let [commands, parties, changes] = Layout::vertical([
        Constraint::Length(1 + counts.len() as u16),
        Constraint::Length(1 + roles.len() as u16),
        Constraint::Fill(1),
    ])
    .areas(area);
    let sent = picture.view.overview.status.map_or(0, |status| status.sent);
    let sent = Line::from(picture.ink(format!("{sent} sent"), Ink::Faint));
    stack(counts, picture.rule("Commands", sent, commands, buf), buf);
    stack(roles, picture.rule("Roles", Line::default(), parties, buf), buf);
    if changes.height >= 2 {
        let area = picture.rule("Changes", Line::default(), changes, buf);
        stack(self::changes(picture), area, buf);
    }
}

/// What became of commands.
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
        let ink = if count > 0 { Ink::Bad } else { Ink::Ok };
        vec![picture.ink(format!("{name} "), Ink::Faint), picture.ink(count.to_string(), ink)]
    };
    // Nothing is said of what most sessions have none of.
    let is_said =
        |(name, count): &(&str, u64)| !["timeouts", "takeovers"].contains(name) || *count > 0;
    flow(counts.into_iter().filter(is_said).map(piece).collect(), width)
}

/// Plant and controller, each with its lamp.
pub fn lamps<'a>(picture: &Picture) -> Line<'a> {
    let mut spans = Vec::new();
    for (name, party, is_silent) in parties(picture) {
        spans.extend([lamp(picture, party, is_silent), Span::raw(format!(" {name} "))]);
    }
    Line::from(spans)
}

/// Plant and controller, each with what is known of it.
fn roles<'a>(picture: &Picture, width: u16, most: usize) -> Vec<Line<'a>> {
    let mut lines = Vec::new();
    for (name, party, is_silent) in parties(picture) {
        let mut pieces =
            vec![vec![lamp(picture, party, is_silent), Span::raw(format!(" {name:<10}"))]];
        match (party.silence(), party.since) {
            (Some(silence), _) if is_silent => {
                let words = format!("silent {:.1} s", silence.as_secs_f64());
                pieces.push(vec![picture.ink(words, Ink::Bad)]);
            }
            (Some(silence), Some(since)) => {
                pieces.push(vec![Span::raw(elapsed(since.elapsed()))]);
                let heard = format!("heard {:.1} s ago", silence.as_secs_f64());
                pieces.push(vec![picture.ink(heard, Ink::Faint)]);
            }
            _ => pieces.push(vec![picture.ink("not heard yet", Ink::Faint)]),
        }
        if let Some(presence) = &party.presence {
            let host = text_of(&presence.host);
            pieces.push(vec![picture.ink(format!("{host} {}", presence.process), Ink::Faint)]);
        }
        let others = picture.live.standing_by();
        if name == "controller" && others > 0 {
            pieces.push(vec![picture.ink(format!("{others} standing by"), Ink::Faint)]);
        }
        lines.extend(flow(pieces, width).into_iter().take(most));
    }
    lines
}

fn parties<'a>(picture: &'a Picture) -> [(&'static str, &'a Party, bool); 2] {
    let alarm = picture.live.alarm();
    let is_over = picture.live.phase() == Some(Phase::Finished);
    let is_quiet =
        |party: &Party| !is_over && party.silence().is_some_and(|silence| silence > QUIET);
    let (plant, controller) = (picture.live.plant(), picture.live.controller());
    let plant_is_silent = matches!(alarm, Some(Alarm::PlantSilent(_)));
    let controller_is_silent = matches!(alarm, Some(Alarm::ControllerSilent(_)));
    [
        ("plant", plant, plant_is_silent || is_quiet(plant)),
        ("controller", controller, controller_is_silent || is_quiet(controller)),
    ]
}

fn lamp<'a>(picture: &Picture, party: &Party, is_silent: bool) -> Span<'a> {
    match party.heard {
        None => picture.ink("·", Ink::Faint),
        Some(_) if is_silent => picture.ink("○", Ink::Bad),
        Some(_) => picture.ink("●", Ink::Ok),
    }
}

/// The newest first.
fn changes<'a>(picture: &Picture) -> Vec<Line<'a>> {
    let overview = &picture.view.overview;
    let lines = overview.changes.iter().rev().map(|change| {
        let time = picture.ink(format!("{:.1} ", change.header.time_ns as f64 * 1e-9), Ink::Faint);
        let words = match change.outcome() {
            Ok(()) => picture.ink(change.words(), Ink::Mark),
            Err(reason) => picture.ink(format!("refused: {reason}"), Ink::Bad),
        };
        Line::from(vec![time, words])
    });
    let none = Line::from(picture.ink("none in this run", Ink::Faint));
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
