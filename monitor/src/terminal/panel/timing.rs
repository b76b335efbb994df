//! The timing of the loop.

use ratatui::{
    buffer::Buffer,
    layout::{Constraint, Layout, Rect},
    symbols::bar::NINE_LEVELS,
    text::{Line, Span},
    widgets::Widget,
};

use super::{Picture, render_lines, session, three_digits};
use crate::{
    durations::{RecentDurations, Spread},
    terminal::palette::Tone,
};

/// The shortest and the longest round trip of the histogram, ns.
const EXTREMES: [f64; 2] = [1e2, 6e10];

/// Round trip, residence and jitter of the last ten seconds, and a histogram of the round trips.
pub(super) fn render(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let area = table(picture, area, buf, true);
    if area.height >= 3 {
        histogram(picture, area, buf);
    }
}

/// Round trip and residence, and the counts of commands.
pub(super) fn brief(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let area = table(picture, area, buf, area.height > 5);
    render_lines(session::counts(picture, area.width), area, buf);
}

fn table(picture: &Picture, area: Rect, buf: &mut Buffer, jitter: bool) -> Rect {
    // The last column is one character wider, for the maximum.
    let column = usize::from((area.width.saturating_sub(11) / 3).clamp(5, 9));
    let last = column + 1;
    let rest = picture.rule("Loop µs", Line::default(), area, buf);
    // The headings of the columns are on the rule.
    let at = Rect { x: area.x + 10, width: area.width.saturating_sub(10), height: 1, ..area };
    for (part, end) in [("p50", column), ("p99", 2 * column), ("max", 2 * column + last)] {
        let end = at.x + end as u16;
        let width = part.len() as u16 + 1;
        let place = Rect { x: end - width, width, ..at }.intersection(area);
        picture.styled(format!(" {part}"), Tone::Faint).render(place, buf);
    }
    let overview = &picture.view.overview;
    let mut rows = vec![
        ("round trip", &overview.round_trips),
        ("residence", &overview.residence),
        ("jitter", &overview.period_deviation),
    ];
    rows.truncate(if jitter { 3 } else { 2 });
    let count = rows.len() as u16;
    let lines = rows.into_iter().map(|(name, durations)| {
        let name = picture.styled(format!("{name:<10}"), Tone::Faint);
        match durations.spread() {
            Some(Spread { p50, p99, max }) => Line::from(vec![
                name,
                Span::raw(format!("{:>column$}{:>column$}", micros(p50), micros(p99))),
                picture.styled(format!("{:>last$}", micros(max)), Tone::Strong),
            ]),
            None => Line::from(vec![name, Span::raw(format!("{:>column$}", "–"))]),
        }
    });
    render_lines(lines, rest, buf);
    let [_, rest] = Layout::vertical([Constraint::Length(count), Constraint::Fill(1)]).areas(rest);
    rest
}

fn micros(value: f64) -> String {
    if value >= 9999.5 { format!("{}k", three_digits(value / 1e3)) } else { three_digits(value) }
}

/// A histogram of the round trips on a logarithmic axis.
fn histogram(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let round_trips = &picture.view.overview.round_trips;
    let Some([low, high]) = extent(round_trips) else { return };
    let counts = round_trips.counts(&edges(low, high, area.width.into()));
    let most = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let [bars, axis] = Layout::vertical([Constraint::Fill(1), Constraint::Length(1)]).areas(area);
    let height = f64::from(bars.height) * 8.0;
    for (column, count) in bars.columns().zip(counts) {
        // The square root makes rare durations visible beside frequent ones.
        let eighths = (height * (count as f64 / most).sqrt()).ceil() as usize;
        for (i, cell) in column.rows().rev().enumerate() {
            let symbol = NINE_LEVELS_UP[eighths.saturating_sub(8 * i).min(8)];
            picture.styled(symbol, Tone::Tip).render(cell, buf);
        }
    }
    let ends = [low, high].map(duration);
    picture.styled(ends[0].clone(), Tone::Faint).render(axis, buf);
    let width = ends[1].chars().count() as u16;
    let right = Rect { x: axis.right().saturating_sub(width), width, ..axis };
    picture.styled(ends[1].clone(), Tone::Faint).render(right, buf);
    let middle = Line::from(picture.styled("round trip", Tone::Faint)).centered();
    if axis.width > 26 {
        middle.render(axis, buf);
    }
}

/// From an empty to a full character.
const NINE_LEVELS_UP: [&str; 9] = [
    NINE_LEVELS.empty,
    NINE_LEVELS.one_eighth,
    NINE_LEVELS.one_quarter,
    NINE_LEVELS.three_eighths,
    NINE_LEVELS.half,
    NINE_LEVELS.five_eighths,
    NINE_LEVELS.three_quarters,
    NINE_LEVELS.seven_eighths,
    NINE_LEVELS.full,
];

/// The range of the round trips, rounded to the logarithmic axis, ns.
fn extent(durations: &RecentDurations) -> Option<[f64; 2]> {
    const PARTS: usize = 96;
    let edges = edges(EXTREMES[0], EXTREMES[1], PARTS);
    let counts = durations.counts(&edges);
    let first = counts.iter().position(|count| *count > 0)?;
    let last = counts.iter().rposition(|count| *count > 0)?;
    Some([edges[first] as f64, edges[last + 1] as f64])
}

fn edges(low: f64, high: f64, parts: usize) -> Vec<u64> {
    let ratio = high / low;
    (0..=parts).map(|i| (low * ratio.powf(i as f64 / parts as f64)).round() as u64).collect()
}

fn duration(ns: f64) -> String {
    let (value, unit) = match ns {
        ns if ns < 1e3 => (ns, "ns"),
        ns if ns < 1e6 => (ns / 1e3, "µs"),
        ns if ns < 1e9 => (ns / 1e6, "ms"),
        ns => (ns / 1e9, "s"),
    };
    let digits = if value < 9.95 { 1 } else { 0 };
    format!("{value:.digits$} {unit}")
}
