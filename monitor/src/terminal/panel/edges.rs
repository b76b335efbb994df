//! What frames the panels: title, facts, banner, keys.

use std::time::Duration;

use mtj_model::{
    law::Description,
    scenario::{MEMORY, PREDICTION, Scenario},
};
use ratatui::{
    buffer::Buffer,
    layout::{Alignment, Rect},
    text::{Line, Span},
    widgets::{Paragraph, Widget, Wrap},
};

use super::{Picture, SMALLEST, figure, session, stack};
use crate::{
    overview::{Alarm, Phase},
    terminal::palette::Ink,
};

/// What it is, and when.
pub fn title(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let scenario = picture.view.scenario().map_or("", |scenario| &scenario.name);
    let mut left = vec![picture.ink("mtj ", Ink::Strong), Span::raw(picture.place)];
    if !scenario.is_empty() {
        left.push(picture.ink(format!(" · {scenario}"), Ink::Faint));
    }
    let mut right = vec![];
    if picture.is_held {
        right.push(picture.ink(" view held ", Ink::Waiting));
        right.push(Span::raw("  "));
    }
    let (phase, ink) = match picture.view.overview.phase() {
        None => ("no plant", Ink::Faint),
        Some(Phase::Waiting) => ("waiting", Ink::Desired),
        Some(Phase::Running) => ("running", Ink::Ok),
        Some(Phase::Finished) => ("finished", Ink::Faint),
        Some(Phase::Paused) => ("paused", Ink::Desired),
    };
    right.push(picture.ink(phase, ink));
    right.push(picture.ink(format!("  t {:.1} s", picture.view.overview.time()), Ink::Strong));
    let right = Line::from(right);
    let width = (right.width() as u16).min(area.width);
    Line::from(left).render(Rect { width: area.width.saturating_sub(width + 1), ..area }, buf);
    right.render(Rect { x: area.right() - width, width, ..area }, buf);
}

/// How the loop is set.
pub fn facts(picture: &Picture, area: Rect, buf: &mut Buffer) {
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
    // The first are the ones that matter; the last go where there is no room.
    let mut line = Line::default();
    for (name, value) in facts {
        let fact = [picture.ink(format!("{name} "), Ink::Faint), Span::raw(format!("{value}  "))];
        if line.width() + fact.iter().map(Span::width).sum::<usize>() > usize::from(area.width) + 2
        {
            break;
        }
        line.spans.extend(fact);
    }
    line.render(area, buf);
}

/// As the plant measured it, and how much of it is emulated.
fn latency(picture: &Picture, scenario: &Scenario) -> Option<(&'static str, String)> {
    let emulated = scenario.link.state.latency + scenario.link.torque.latency;
    let measured = picture.view.overview.state.as_ref().map_or(0, |state| state.latency_ns);
    let mut words = format!("{} ms", figure(measured as f64 * 1e-6));
    if emulated > Duration::ZERO {
        words += &format!(" (emulated {emulated:?})");
    }
    (measured > 0).then_some(("latency", words))
}

/// The policy of the memory and the horizon of the prediction, where the law has them.
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

/// What should not go unnoticed.
pub fn banner(picture: &Picture, alarm: Alarm, area: Rect, buf: &mut Buffer) {
    let ink = match alarm {
        Alarm::PlantSilent(_) | Alarm::ControllerSilent(_) => Ink::Alarm,
        Alarm::NoPlant | Alarm::NoController => Ink::Waiting,
    };
    buf.set_style(area, picture.palette.style(ink));
    Line::from(alarm.sentence()).centered().style(picture.palette.style(ink)).render(area, buf);
}

/// What can be pressed, and what there is to say besides: at least who is there, where nothing
/// else says so.
pub fn keys(picture: &Picture, has_roles: bool, area: Rect, buf: &mut Buffer) {
    let hold = if picture.is_held { "go on" } else { "hold" };
    let window = format!("{} s", picture.window);
    let keys = [("q", "quit"), ("space", hold), ("+/−", &window), ("?", "keys")];
    let left = Line::from_iter(keys.into_iter().flat_map(|(key, what)| {
        [picture.ink(key, Ink::Strong), picture.ink(format!(" {what}  "), Ink::Faint)]
    }));
    let width = left.width() as u16;
    left.render(area, buf);
    let missed = picture.view.overview.missed;
    let right = match &picture.aside {
        Some(aside) => picture.ink(aside.clone(), Ink::Bad).into(),
        None if missed > 0 => {
            picture.ink(format!("this monitor missed {missed} samples"), Ink::Bad).into()
        }
        None if has_roles => Line::default(),
        None => session::lamps(picture),
    };
    let room = area.width.saturating_sub(width);
    let width = room.min(right.width() as u16);
    right.render(Rect { x: area.right() - width, width, ..area }, buf);
}

/// What the keys do.
pub fn help(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let row = |key: &'static str, what: &'static str| {
        Line::from(vec![picture.ink(format!("  {key:<10}"), Ink::Strong), Span::raw(what)])
    };
    let lines = [
        Line::from(picture.ink("Keys", Ink::Strong)),
        row("q Esc ^C", "quit; nothing but this view ends"),
        row("space", "hold the view, to read it, or let it go on; alarms and"),
        row("", "roles stay live, and nothing is missed meanwhile"),
        row("+  −", "more or less time on the charts, up to five minutes"),
        row("?", "these lines"),
        Line::default(),
        Line::from("Charts keep the smallest and the largest of what they thin out:"),
        Line::from("a peak of one sample is drawn. Times are of the last 10 s."),
        Line::from("A dotted upright line on a chart is a knob that was turned."),
    ];
    stack(lines, area, buf);
}

/// Says how large a screen should be.
pub fn too_small(picture: &Picture, area: Rect, buf: &mut Buffer) {
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
