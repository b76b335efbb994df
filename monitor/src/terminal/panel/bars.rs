//! The lines above and below the panels: title, settings, banner, keys.

use std::time::Duration;

use mtj_model::{
    law::Description,
    scenario::{MEMORY, PREDICTION, Scenario},
};
use mtj_protocol::sample::Phase;
use ratatui::{
    buffer::Buffer,
    layout::{Alignment, Rect},
    text::{Line, Span},
    widgets::{Paragraph, Widget, Wrap},
};
use tracing::Level;

use super::{Picture, SMALLEST, render_lines, session, three_digits};
use crate::{overview::Alarm, terminal::palette::Tone};

/// The title: session and scenario, phase and time.
pub(super) fn title(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let scenario = picture.view.scenario().map_or("", |scenario| &scenario.name);
    let mut left = vec![picture.styled("mtj ", Tone::Strong), Span::raw(picture.session)];
    if !scenario.is_empty() {
        left.push(picture.styled(format!(" · {scenario}"), Tone::Faint));
    }
    let mut right = vec![];
    if picture.is_held {
        right.push(picture.styled(" view held ", Tone::Waiting));
        right.push(Span::raw("  "));
    }
    let phase = picture.view.overview.phase();
    let tone = match phase {
        Some(Phase::Running) => Tone::Ok,
        Some(Phase::Waiting | Phase::Paused) => Tone::Desired,
        Some(Phase::Diverged | Phase::Stopped) => Tone::Bad,
        Some(Phase::Finished) | None => Tone::Faint,
    };
    right.push(picture.styled(phase.map_or("no plant", Phase::name), tone));
    right.push(picture.styled(format!("  t {:.1} s", picture.view.overview.time()), Tone::Strong));
    let right = Line::from(right);
    let width = (right.width() as u16).min(area.width);
    Line::from(left).render(Rect { width: area.width.saturating_sub(width + 1), ..area }, buf);
    right.render(Rect { x: area.right() - width, width, ..area }, buf);
}

/// The settings of the loop that matter most.
pub(super) fn facts(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let mut facts = Vec::new();
    let overview = &picture.view.overview;
    if let Some(scenario) = picture.view.scenario() {
        let law = overview.law();
        facts.push(("law", law.map_or("unknown", |law| law.name).to_owned()));
        facts.push(("T_s", format!("{:?}", scenario.timing.sample_period)));
        let (memory, prediction) = memory_and_prediction(scenario, law);
        facts.extend(memory.map(|policy| ("memory", policy)));
        facts.extend(latency(picture, scenario));
        facts.extend(prediction.map(|horizon| ("prediction", horizon)));
        if scenario.noise > 0.0 {
            facts.push(("noise", scenario.noise.to_string()));
        }
        facts.push(("clock", scenario.timing.clock.name().to_owned()));
    }
    // In the order of importance; a narrow screen omits the last ones.
    let mut line = Line::default();
    for (name, value) in facts {
        let fact =
            [picture.styled(format!("{name} "), Tone::Faint), Span::raw(format!("{value}  "))];
        if line.width() + fact.iter().map(Span::width).sum::<usize>() > usize::from(area.width) + 2
        {
            break;
        }
        line.spans.extend(fact);
    }
    line.render(area, buf);
}

/// The latency that the plant measured, and how much of it is emulated.
fn latency(picture: &Picture, scenario: &Scenario) -> Option<(&'static str, String)> {
    let emulated = scenario.link.state.latency + scenario.link.torque.latency;
    let measured = picture.view.overview.state.as_ref().map_or(0, |state| state.latency_ns);
    let mut words = format!("{} ms", three_digits(measured as f64 * 1e-6));
    if emulated > Duration::ZERO {
        words += &format!(" (emulated {emulated:?})");
    }
    (measured > 0).then_some(("latency", words))
}

/// The policy of the memory and the horizon of the prediction, if the law has them.
fn memory_and_prediction(
    scenario: &Scenario,
    law: Option<&Description>,
) -> (Option<String>, Option<String>) {
    let settings = scenario.settings();
    let word = |parameter| settings.get(parameter)?.as_str().map(str::to_owned);
    let has_memory = law.is_some_and(|law| law.has_memory);
    let policy = MEMORY.first().filter(|_| has_memory).and_then(word);
    (policy, PREDICTION.first().and_then(word).filter(|horizon| horizon != "none"))
}

/// The banner of an alarm.
pub(super) fn banner(picture: &Picture, alarm: Alarm, area: Rect, buf: &mut Buffer) {
    let tone = if alarm.is_about_waiting() { Tone::Waiting } else { Tone::Alarm };
    buf.set_style(area, picture.palette.style(tone));
    Line::from(alarm.sentence()).centered().style(picture.palette.style(tone)).render(area, buf);
}

/// The keys, and on the right a log line, missed samples or, if no panel shows them, the roles.
pub(super) fn keys(picture: &Picture, has_roles: bool, area: Rect, buf: &mut Buffer) {
    let hold = if picture.is_held { "go on" } else { "hold" };
    let window = format!("{} s", picture.window);
    let keys = [("q", "quit"), ("space", hold), ("+/−", &window), ("?", "keys")];
    let left = Line::from_iter(keys.into_iter().flat_map(|(key, what)| {
        [picture.styled(key, Tone::Strong), picture.styled(format!(" {what}  "), Tone::Faint)]
    }));
    let width = left.width() as u16;
    left.render(area, buf);
    let missed = picture.view.overview.missed;
    let right = match &picture.log_line {
        Some(line) => {
            let is_bad = line.level <= Level::WARN;
            picture.styled(&line.text, if is_bad { Tone::Bad } else { Tone::Faint }).into()
        }
        None if missed > 0 => {
            picture.styled(format!("this monitor missed {missed} samples"), Tone::Bad).into()
        }
        None if has_roles => Line::default(),
        None => session::indicators(picture),
    };
    let room = area.width.saturating_sub(width);
    let width = room.min(right.width() as u16);
    right.render(Rect { x: area.right() - width, width, ..area }, buf);
}

/// The help: what the keys do.
pub(super) fn help(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let row = |key: &'static str, what: &'static str| {
        Line::from(vec![picture.styled(format!("  {key:<10}"), Tone::Strong), Span::raw(what)])
    };
    let lines = [
        Line::from(picture.styled("Keys", Tone::Strong)),
        row("q Esc ^C", "quit; only this view ends"),
        row("space", "hold the view, to read it, or let it go on; alarms and"),
        row("", "roles stay live, and no data is lost meanwhile"),
        row("+  −", "more or less time on the charts, up to five minutes"),
        row("?", "these lines"),
        Line::default(),
        Line::from("Charts show minimum and maximum of all samples in a column: a peak"),
        Line::from("of one sample is drawn. Times are of the last 10 s."),
        Line::from("A dotted vertical line on a chart is a change of the loop."),
    ];
    render_lines(lines, area, buf);
}

/// Shown instead of the panels: how large the screen must be.
pub(super) fn too_small(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let (width, height) = SMALLEST;
    let mut words = format!(
        "This terminal is {} × {}; the dashboard needs {width} × {height}. Make it larger, or press q.",
        area.width, area.height
    );
    if let Some(alarm) = picture.live.alarm() {
        words = format!("{}. {words}", alarm.sentence());
    }
    Paragraph::new(words).wrap(Wrap { trim: true }).alignment(Alignment::Left).render(area, buf);
}
